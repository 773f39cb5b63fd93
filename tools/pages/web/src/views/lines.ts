// Draws curves with their names in a legend: the errors of a study, or the coverage of its regions.
import {dot, line, plot, rectY} from '@observablehq/plot';
import type {Lines} from '../data';
import {colours, legend, palette, responsive, significant} from '../figure';

// A name has the same colour in all charts of a page.
const known = new Map<string, string>();
function colourOf(name: string): string {
  if (!known.has(name)) known.set(name, palette[known.size % palette.length]!);
  return known.get(name)!;
}

export function lines(figure: HTMLElement, data: Lines): void {
  const isLinear = (axis: 'x' | 'y') => data.linear?.includes(axis) ?? false;
  const isShown = ([x, y]: [number, number]) => (isLinear('x') || x > 0) && (isLinear('y') || y > 0);
  const drawn = data.lines
      .map((entry) => ({
        ...entry,
        points: entry.points.filter(isShown),
        colour: entry.reference ? colours.dim : colourOf(entry.name),
      }))
      .filter((entry) => entry.points.length > 0);
  figure.append(legend(drawn.map(({name, colour}) => ({name, colour}))));
  responsive(figure, (width) => plot({
    width,
    height: Math.min(0.6 * width, 420),
    marginLeft: 56,
    grid: true,
    x: {type: isLinear('x') ? 'linear' : 'log', label: data.x_label, tickFormat: (value: number) => significant(value), ticks: Math.max(2, width / 90)},
    y: {type: isLinear('y') ? 'linear' : 'log', label: data.y_label, tickFormat: (value: number) => significant(value), ticks: 5},
    marks: [
      ...(data.band ? [rectY([data.band], {y1: '0', y2: '1', fill: colours.dim, fillOpacity: 0.15})] : []),
      ...drawn.flatMap((entry) => [
      line(entry.points, {
        x: '0', y: '1', stroke: entry.colour, strokeWidth: entry.strong ? 3 : 1.5,
        strokeDasharray: entry.reference ? '6 4' : ''}),
      dot(entry.points, {
        x: '0', y: '1', r: entry.reference ? 1.5 : 3, fill: entry.colour,
        channels: {what: {value: (point: [number, number]) => `${entry.name}: ${significant(point[1])} at ${significant(point[0])}`, label: ''}},
        tip: {format: {x: false, y: false, what: true}}}),
      ]),
    ],
  }), 820);
}
