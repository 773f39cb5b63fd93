// Draws slices through the workspace of an arm: the correction of the gripper's position, and its uncertainty.
import {dot, plot, rect} from '@observablehq/plot';
import type {ArmMaps} from '../data';
import {colours, element, responsive, significant} from '../figure';

interface Cell {
  x: number;
  y: number;
  correction: number;
  sigma: number;
}

export function armMap(figure: HTMLElement, data: ArmMaps): void {
  const charts = element('div', 'charts');
  figure.append(charts);
  for (const map of data.maps) {
    const half = map.step / 2;
    const cells: Cell[] = map.cells.map(([x, y, correction, sigma]) => ({x, y, correction, sigma}));
    const heights = [...map.cells.flatMap(([, y]) => [y - half, y + half]), ...map.captures.map(([, y]) => y)];
    const x = data.x;
    const y: [number, number] = [Math.min(...heights), Math.max(...heights)];
    for (const [what, colour] of [['correction', colours.first], ['sigma', colours.second]] as const) {
      const values = cells.map((cell) => cell[what]);
      const least = Math.min(...values);
      const most = Math.max(...values);
      const place = element('div', 'chart wide-chart');
      place.append(element('div', '', `${what} ${significant(least, 2)} to ${significant(most, 2)} mm`));
      charts.append(place);
      const left = 46;
      responsive(place, (width) => plot({
        width, height: ((width - left - 8) * (y[1] - y[0])) / (x[1] - x[0]) + 56,
        marginLeft: left, marginRight: 8, marginTop: 22, marginBottom: 34,
        x: {domain: x, label: 'base x, mm', ticks: 4},
        y: {domain: y, label: `base ${map.vertical}, mm`, ticks: 4},
        marks: [
          rect(cells, {
            x1: (cell: Cell) => cell.x - half, x2: (cell: Cell) => cell.x + half,
            y1: (cell: Cell) => cell.y - half, y2: (cell: Cell) => cell.y + half, inset: 0.3, fill: colour,
            fillOpacity: (cell: Cell) => (most > least ? 0.08 + (0.92 * (cell[what] - least)) / (most - least) : 0.5),
            channels: {what: {value: (cell: Cell) =>
                `correction ${significant(cell.correction, 3)} mm, sigma ${significant(cell.sigma, 2)} mm`, label: ''}},
            tip: {format: {x: false, y: false, x1: false, x2: false, y1: false, y2: false, fill: false, fillOpacity: false, what: true}}}),
          dot(map.captures, {x: '0', y: '1', r: 2, fill: colours.ink}),
        ],
      }), 360);
    }
  }
}
