// Draws the radial component of the residuals against the distance from the principal point, and its mean in ten
// rings with equal numbers of points. A mean that deviates from zero indicates an error of the lens model.
import {dot, line, plot, ruleY} from '@observablehq/plot';
import type {Captures} from '../data';
import {colours, legend, responsive} from '../figure';
import {residualsOf, thinned} from './residual_field';

const kMaxDots = 3000;
const kRings = 10;

export function residualRadius(figure: HTMLElement, data: Captures): void {
  const all = residualsOf(data)
      .map(({x, y, dx, dy}) => {
        const [u, v] = [x - data.centre[0], y - data.centre[1]];
        const radius = Math.hypot(u, v);
        return {radius, outward: radius > 0 ? (u * dx + v * dy) / radius : 0};
      })
      .sort((a, b) => a.radius - b.radius);
  if (all.length === 0) {
    figure.append('No points to show.');
    return;
  }
  const mean = (values: number[]) => values.reduce((sum, value) => sum + value, 0) / values.length;
  const rings = Array.from({length: kRings}, (_, i) =>
      all.slice(Math.floor((all.length * i) / kRings), Math.floor((all.length * (i + 1)) / kRings)))
      .filter((ring) => ring.length > 0)
      .map((ring) => ({radius: mean(ring.map((r) => r.radius)), outward: mean(ring.map((r) => r.outward))}));
  figure.append(legend([{name: 'point', colour: colours.first}, {name: 'mean', colour: colours.second}]));
  responsive(figure, (width) => plot({
    width, height: 240, marginLeft: 50, marginBottom: 34, grid: true,
    x: {label: 'distance from the principal point, px', ticks: Math.max(2, width / 90)},
    y: {label: 'radial residual, px', ticks: 5},
    marks: [
      dot(thinned(all, kMaxDots), {x: 'radius', y: 'outward', r: 1.3, fill: colours.first, fillOpacity: 0.6}),
      ruleY([0], {stroke: colours.dim}),
      line(rings, {x: 'radius', y: 'outward', stroke: colours.second, strokeWidth: 2.5, marker: 'dot'}),
    ],
  }));
}
