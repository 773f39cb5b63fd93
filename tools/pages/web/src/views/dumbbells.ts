// Draws one row for each entry with one dot for each series on a logarithmic axis, joined by a line. Larger values
// are worse.
import {axisX, dot, gridX, link, plot, text} from '@observablehq/plot';
import type {Dumbbells} from '../data';
import {colours, legend, responsive, significant} from '../figure';

const kColours = [colours.first, colours.second, colours.ink];

export function dumbbells(figure: HTMLElement, data: Dumbbells): void {
  const dots = data.rows.flatMap((row, index) =>
      row.values.map((value, series) => ({index, label: row.label, value, series}))
          .filter((entry): entry is typeof entry & {value: number} => entry.value !== null && entry.value > 0));
  if (dots.length === 0) {
    figure.append('No figures to show.');
    return;
  }
  const bars = data.rows.flatMap((row, index) => {
    const known = row.values.filter((value): value is number => value !== null && value > 0);
    return known.length > 1 ? [{index, low: Math.min(...known), high: Math.max(...known)}] : [];
  });
  const low = Math.min(...dots.map((entry) => entry.value)) / 1.3;
  const high = Math.max(...dots.map((entry) => entry.value)) * 1.3;
  const longest = Math.max(...data.rows.map((row) => row.label.length));
  figure.append(legend(data.series.map((name, i) => ({name, colour: kColours[i] ?? colours.ink}))));
  const marginOf = (width: number) => Math.min(10 + 6.6 * longest, 0.45 * width);
  responsive(figure, (width) => plot({
    width,
    height: 50 + 20 * data.rows.length,
    marginLeft: marginOf(width),
    marginRight: 16,
    x: {type: 'log', domain: [low, high], label: data.unit, tickFormat: (value: number) => significant(value)},
    y: {type: 'band', domain: data.rows.map((_, i) => i), axis: null, padding: 0.2},
    marks: [
      gridX({stroke: colours.line, strokeOpacity: 1, ticks: Math.max(2, width / 110)}),
      axisX({ticks: Math.max(2, width / 110), label: data.unit, tickFormat: (value: number) => significant(value)}),
      ...[true, false].map((strong) => text(data.rows.flatMap((row, index) => (Boolean(row.strong) === strong ? [{...row, index}] : [])), {
        x: low, y: 'index', text: 'label', dx: -8, textAnchor: 'end', lineWidth: (marginOf(width) - 10) / 10, textOverflow: 'ellipsis',
        fontWeight: strong ? 'bold' : 'normal'})),
      link(bars, {x1: 'low', x2: 'high', y1: 'index', y2: 'index', stroke: colours.dim, strokeOpacity: 0.6, strokeWidth: 2}),
      dot(dots, {
        x: 'value', y: 'index', r: 5, fill: (entry: {series: number}) => kColours[entry.series] ?? colours.ink,
        channels: {what: {value: (entry: {label: string; series: number; value: number}) =>
            `${entry.label}, ${data.series[entry.series]}: ${significant(entry.value)} ${data.unit}`, label: ''}},
        tip: {format: {x: false, y: false, fill: false, what: true}}}),
    ],
  }));
}
