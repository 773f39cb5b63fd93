// Draws the corrections of an arm's parameters with one sigma to both sides, one chart for each unit.
import {axisX, dot, gridX, link, plot, ruleX, text} from '@observablehq/plot';
import type {ArmCorrections} from '../data';
import {colours, element, responsive, significant} from '../figure';

export function armCorrections(figure: HTMLElement, data: ArmCorrections): void {
  const charts = element('div', 'columns');
  figure.append(charts);
  for (const panel of data.panels) {
    const rows = panel.names.map((name, i) => {
      const value = panel.values[i] ?? 0;
      const sigma = panel.sigmas[i] ?? 0;
      return {name, value, sigma, low: value - sigma, high: value + sigma};
    });
    const reach = 1.1 * Math.max(...rows.map(({value, sigma}) => Math.abs(value) + sigma));
    if (!(reach > 0)) continue;
    const place = element('div');
    charts.append(place);
    responsive(place, (width) => plot({
      width, height: 50 + 18 * rows.length, marginLeft: 100, marginRight: 16,
      x: {domain: [-reach, reach]},
      y: {type: 'band', domain: panel.names, axis: null, padding: 0.2},
      marks: [
        gridX({stroke: colours.line, strokeOpacity: 1, ticks: Math.max(2, width / 90)}),
        axisX({ticks: Math.max(2, width / 90), label: `correction, ${panel.unit}`, tickFormat: (value: number) => significant(value)}),
        ruleX([0], {stroke: colours.dim}),
        text(rows, {x: -reach, y: 'name', text: 'name', dx: -8, textAnchor: 'end'}),
        link(rows, {x1: 'low', x2: 'high', y1: 'name', y2: 'name', stroke: colours.first, strokeWidth: 2}),
        dot(rows, {
          x: 'value', y: 'name', r: 3.5, fill: colours.first,
          channels: {what: {value: (row: {name: string; value: number; sigma: number}) =>
              `${row.name}: ${significant(row.value)} \u00b1 ${significant(row.sigma, 2)} ${panel.unit}`, label: ''}},
          tip: {format: {x: false, y: false, what: true}}}),
      ],
    }), 560);
  }
}
