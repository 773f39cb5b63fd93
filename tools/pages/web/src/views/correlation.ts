// Draws the correlation matrix of the parameters as cells, from -1 to 1.
import {axisX, axisY, cell, plot} from '@observablehq/plot';
import type {Correlation} from '../data';
import {colours, legend, responsive, significant} from '../figure';

export function correlation(figure: HTMLElement, data: Correlation): void {
  const cells = data.matrix.flatMap((row, i) => row.map((value, j) => ({i, j, value})));
  const longest = Math.max(...data.names.map((name) => name.length));
  figure.append(legend([{name: 'positive', colour: colours.second}, {name: 'negative', colour: colours.first}]));
  responsive(figure, (width) => {
    const margin = 12 + 6 * longest;
    const size = Math.min(26, (width - margin - 4) / data.names.length);
    const labels = {tickSize: 0, tickFormat: (i: number) => data.names[i] ?? '', fontSize: Math.max(7, Math.min(11, size))};
    return plot({
      width: margin + 4 + size * data.names.length, height: margin + 4 + size * data.names.length,
      marginLeft: margin, marginBottom: margin, marginRight: 4, marginTop: 4,
      x: {type: 'band', domain: data.names.map((_, i) => i), padding: 0.06, label: null},
      y: {type: 'band', domain: data.names.map((_, i) => i), padding: 0.06, label: null},
      marks: [
        axisX({...labels, tickRotate: -90}),
        axisY(labels),
        cell(cells, {
          x: 'j', y: 'i', fill: (entry: {value: number | null}) => ((entry.value ?? 0) < 0 ? colours.first : colours.second),
          fillOpacity: (entry: {value: number | null}) => Math.abs(entry.value ?? 0),
          channels: {what: {value: (entry: {i: number; j: number; value: number | null}) =>
              `${data.names[entry.i]}, ${data.names[entry.j]}: ${significant(entry.value, 2)}`, label: ''}},
          tip: {format: {x: false, y: false, fill: false, fillOpacity: false, what: true}}}),
      ],
    });
  });
}
