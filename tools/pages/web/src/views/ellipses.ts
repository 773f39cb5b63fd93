// Draws the one-sigma ellipse and the 95 % region, one small chart for each pair of axes; charts of the same unit
// have the same scale.
import {dot, line, plot} from '@observablehq/plot';
import type {Ellipses} from '../data';
import {colours, element, responsive, significant} from '../figure';

function outline([xx, xy, yy]: [number, number, number], sigmas: number): [number, number][] {
  // The outline is the unit circle mapped by the Cholesky factor of the covariance.
  const a = Math.sqrt(Math.max(xx, 0));
  const b = a > 0 ? xy / a : 0;
  const c = Math.sqrt(Math.max(yy - b * b, 0));
  return Array.from({length: 97}, (_, i) => {
    const angle = (2 * Math.PI * i) / 96;
    return [sigmas * a * Math.cos(angle), sigmas * (b * Math.cos(angle) + c * Math.sin(angle))];
  });
}

export function ellipses(figure: HTMLElement, data: Ellipses): void {
  const charts = element('div', 'charts');
  figure.append(charts);
  for (const ellipse of data.ellipses) {
    const same = data.ellipses.filter(({unit}) => unit === ellipse.unit);
    const largest = Math.max(...same.map(({covariance}) => Math.sqrt(Math.max(covariance[0], covariance[2]))));
    const reach = 1.1 * ellipse.reach_95 * largest;
    if (!(reach > 0)) continue;
    const domain: [number, number] = [-reach, reach];
    const place = element('div', 'chart');
    charts.append(place);
    responsive(place, (width) => plot({
      width, height: width, marginLeft: 46, marginBottom: 34, marginRight: 8, marginTop: 22, grid: true,
      x: {domain, label: `${ellipse.x_label}, ${ellipse.unit}`, ticks: 4, tickFormat: (value: number) => significant(value)},
      y: {domain, label: `${ellipse.y_label}, ${ellipse.unit}`, ticks: 4, tickFormat: (value: number) => significant(value)},
      marks: [
        line(outline(ellipse.covariance, ellipse.reach_95), {x: '0', y: '1', stroke: colours.first, fill: colours.first, fillOpacity: 0.12, strokeDasharray: '4 3'}),
        line(outline(ellipse.covariance, 1), {x: '0', y: '1', stroke: colours.first, fill: colours.first, fillOpacity: 0.3, strokeWidth: 2}),
        dot([[0, 0]], {x: '0', y: '1', r: 2, fill: colours.ink}),
      ],
    }), 260);
  }
}
