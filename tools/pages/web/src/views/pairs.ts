// Compares runs pairwise: the distance between their hand-eye poses, and whether their uncertainties explain it.
import {axisX, axisY, cell, plot, text} from '@observablehq/plot';
import type {Pairs} from '../data';
import {colours, legend, responsive, significant} from '../figure';

const kSignificant = 0.01;

export function pairs(figure: HTMLElement, data: Pairs): void {
  const cells = data.pairs.flatMap((pair) => [{...pair, i: pair.first, j: pair.second}, {...pair, i: pair.second, j: pair.first}]);
  const longest = Math.max(...data.runs.map((run) => run.length));
  figure.append(legend([
    {name: 'within their uncertainties (stronger: less likely)', colour: colours.first},
    {name: `beyond their uncertainties (chance below ${kSignificant})`, colour: colours.second},
  ]));
  responsive(figure, (width) => {
    const margin = Math.min(12 + 6.2 * longest, 0.45 * width);
    const size = Math.min(64, (width - margin - 4) / data.runs.length);
    const labels = {tickSize: 0, tickFormat: (i: number) => data.runs[i] ?? '', lineWidth: margin / 11, textOverflow: 'ellipsis' as const};
    const domain = data.runs.map((_, i) => i);
    const height = Math.min(40, size) * data.runs.length;
    return plot({
      width: margin + 4 + size * data.runs.length, height: margin + 4 + height,
      marginLeft: margin, marginBottom: margin, marginRight: 4, marginTop: 4,
      x: {type: 'band', domain, padding: 0.04, label: null},
      y: {type: 'band', domain, padding: 0.04, label: null},
      marks: [
        axisX({...labels, tickRotate: -90}),
        axisY(labels),
        cell(cells, {
          x: 'j', y: 'i', fillOpacity: (pair: {chance: number}) => 0.12 + 0.7 * Math.min(1, -Math.log10(Math.max(pair.chance, 1e-9)) / 4),
          fill: (pair: {chance: number}) => (pair.chance < kSignificant ? colours.second : colours.first),
          channels: {what: {value: (pair: (typeof cells)[number]) =>
              `${data.runs[pair.i]} and ${data.runs[pair.j]}: ${significant(pair.mm)} mm (sigma ${significant(pair.sigma_mm)}), ` +
              `${significant(pair.deg)} deg (sigma ${significant(pair.sigma_deg)}), chance ${significant(pair.chance, 1)}`, label: ''}},
          tip: {format: {x: false, y: false, fill: false, fillOpacity: false, what: true}}}),
        size > 34 ? text(cells, {x: 'j', y: 'i', text: (pair: {mm: number}) => significant(pair.mm, 2), fill: colours.ink}) : null,
      ],
    });
  }, 1160);
}
