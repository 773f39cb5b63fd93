// Curves against each other on logarithmic axes, the names in a legend: a study's errors against the noise.
import {dot, line, plot} from '@observablehq/plot';
import type {Lines} from '../data';
import {colours, legend, palette, responsive, significant} from '../figure';

export function lines(figure: HTMLElement, data: Lines): void {
  let next = 0;
  const drawn = data.lines
      .map((entry) => ({
        ...entry,
        points: entry.points.filter(([x, y]) => x > 0 && y > 0),
        colour: entry.reference ? colours.dim : palette[next++ % palette.length]!,
      }))
      .filter((entry) => entry.points.length > 0);
  figure.append(legend(drawn.map(({name, colour}) => ({name, colour}))));
  responsive(figure, (width) => plot({
    width,
    height: Math.min(0.6 * width, 420),
    marginLeft: 56,
    grid: true,
    x: {type: 'log', label: data.x_label, tickFormat: (value: number) => significant(value), ticks: Math.max(2, width / 90)},
    y: {type: 'log', label: data.y_label, tickFormat: (value: number) => significant(value), ticks: 5},
    marks: drawn.flatMap((entry) => [
      line(entry.points, {
        x: '0', y: '1', stroke: entry.colour, strokeWidth: entry.strong ? 3 : 1.5,
        strokeDasharray: entry.reference ? '6 4' : ''}),
      dot(entry.points, {
        x: '0', y: '1', r: entry.reference ? 1.5 : 3, fill: entry.colour,
        channels: {what: {value: (point: [number, number]) => `${entry.name}: ${significant(point[1])} at ${significant(point[0])}`, label: ''}},
        tip: {format: {x: false, y: false, what: true}}}),
    ]),
  }), 820);
}
