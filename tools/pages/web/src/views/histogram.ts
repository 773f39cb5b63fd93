// Draws a histogram of the residuals in x and y together, and the normal distribution of the stated sigma.
import {line, plot, rectY, ruleY} from '@observablehq/plot';
import type {Captures} from '../data';
import {colours, legend, responsive} from '../figure';
import {residualsOf} from './residual_field';

const kBins = 41;

export function histogram(figure: HTMLElement, data: Captures): void {
  const all = residualsOf(data).flatMap(({dx, dy}) => [dx, dy]);
  const sigma = data.sigma_px;
  if (all.length === 0 || !(sigma > 0)) {
    figure.append('No points to show.');
    return;
  }
  // Residuals beyond this range are counted in the outermost bins.
  const reach = 5 * sigma;
  const width = (2 * reach) / kBins;
  const counts = Array.from({length: kBins}, (_, i) => ({x1: -reach + i * width, x2: -reach + (i + 1) * width, count: 0}));
  for (const value of all) counts[Math.min(kBins - 1, Math.max(0, Math.floor((value + reach) / width)))]!.count += 1;
  const normal = Array.from({length: 201}, (_, i) => {
    const x = -reach + (2 * reach * i) / 200;
    return [x, (all.length * width * Math.exp(-0.5 * (x / sigma) ** 2)) / (sigma * Math.sqrt(2 * Math.PI))];
  });
  figure.append(legend([{name: 'residuals', colour: colours.first}, {name: 'normal distribution', colour: colours.second}]));
  responsive(figure, (wide) => plot({
    width: wide, height: 240, marginLeft: 50, marginBottom: 34,
    x: {label: 'predicted minus observed, px', ticks: Math.max(2, wide / 90)},
    y: {label: 'number of coordinates', grid: true, ticks: 4},
    marks: [
      rectY(counts, {x1: 'x1', x2: 'x2', y: 'count', fill: colours.first, fillOpacity: 0.7, inset: 0.5}),
      line(normal, {x: '0', y: '1', stroke: colours.second, strokeWidth: 2}),
      ruleY([0], {stroke: colours.dim}),
    ],
  }));
}
