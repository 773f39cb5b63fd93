// Draws the share of points in each cell of the image, which shows where the captures constrain the lens model.
import {frame, plot, rect, text} from '@observablehq/plot';
import type {Captures} from '../data';
import {colours, responsive, significant} from '../figure';

export function coverage(figure: HTMLElement, data: Captures): void {
  const [width, height] = data.image_size;
  const columns = 8;
  const rows = Math.max(1, Math.round((columns * height) / width));
  const cells = Array.from({length: rows * columns}, (_, i) => ({
    x1: -0.5 + (width * (i % columns)) / columns, x2: -0.5 + (width * ((i % columns) + 1)) / columns,
    y1: -0.5 + (height * Math.floor(i / columns)) / rows, y2: -0.5 + (height * (Math.floor(i / columns) + 1)) / rows, count: 0}));
  let total = 0;
  for (const {points} of data.captures) {
    for (let i = 0; i + 3 < points.length; i += 4) {
      const column = Math.min(columns - 1, Math.max(0, Math.floor(((points[i]! + 0.5) / width) * columns)));
      const row = Math.min(rows - 1, Math.max(0, Math.floor(((points[i + 1]! + 0.5) / height) * rows)));
      cells[row * columns + column]!.count += 1;
      total += 1;
    }
  }
  const most = Math.max(1, ...cells.map(({count}) => count));
  const percent = ({count}: {count: number}) => (count === 0 ? 'none' : significant((100 * count) / Math.max(total, 1), 2));
  responsive(figure, (wide) => plot({
    width: wide, height: (wide * height) / width, margin: 1,
    x: {domain: [-0.5, width - 0.5], axis: null},
    y: {domain: [height - 0.5, -0.5], axis: null},
    marks: [
      rect(cells, {
        x1: 'x1', x2: 'x2', y1: 'y1', y2: 'y2', inset: 0.5, fill: colours.first,
        fillOpacity: (entry: {count: number}) => 0.85 * Math.sqrt(entry.count / most)}),
      text(cells, {
        x: (entry: {x1: number; x2: number}) => (entry.x1 + entry.x2) / 2,
        y: (entry: {y1: number; y2: number}) => (entry.y1 + entry.y2) / 2, text: percent,
        fill: (entry: {count: number}) => (entry.count === 0 ? colours.bad : colours.ink), fontSize: Math.min(12, wide / 45)}),
      frame({stroke: colours.dim}),
    ],
  }), 560);
}
