// Draws the RMS residual of each capture in their order; a click opens the capture.
import {barY, plot, ruleY} from '@observablehq/plot';
import type {Captures} from '../data';
import {openCapture} from '../capture_dialog';
import {colours, legend, responsive, significant} from '../figure';

export function captureBars(figure: HTMLElement, data: Captures): void {
  const bars = data.captures.map((capture, index) => ({index, image: capture.image, rms: capture.rms_px}));
  const known = bars.flatMap(({rms}) => (rms === null ? [] : [rms]));
  if (known.length === 0) {
    figure.append('No capture was used.');
    return;
  }
  const overall = data.rms_px ?? 0;
  const isLarge = (rms: number) => rms > 2 * overall;
  if (known.some(isLarge)) {
    figure.append(legend([{name: 'RMS', colour: colours.first}, {name: 'more than twice that of all points', colour: colours.second}]));
  }
  responsive(figure, (width) => {
    const chart = plot({
      width, height: 200, marginLeft: 50, marginBottom: 30,
      x: {type: 'band', domain: bars.map(({index}) => index), label: 'capture number', padding: 0.15,
          ticks: bars.filter(({index}) => index % Math.ceil((bars.length * 26) / width) === 0).map(({index}) => index),
          tickFormat: (index: number) => String(index + 1)},
      y: {label: 'rms, px', grid: true, ticks: 4},
      marks: [
        barY(bars.filter(({rms}) => rms !== null), {
          x: 'index', y: 'rms', className: 'bars',
          fill: (bar: {rms: number}) => (isLarge(bar.rms) ? colours.second : colours.first),
          channels: {what: {value: (bar: {index: number; image: string; rms: number}) => `${bar.index + 1}: ${bar.image}, ${significant(bar.rms)} px`, label: ''}},
          tip: {format: {x: false, y: false, fill: false, what: true}}}),
        ruleY([overall], {stroke: colours.ink, strokeDasharray: '4 3'}),
        ruleY([0], {stroke: colours.dim}),
      ],
    });
    // The value of the chart is the datum under the pointer.
    chart.addEventListener('click', () => {
      const at = (chart as unknown as {value: {index: number} | null}).value;
      if (at) openCapture(data, at.index);
    });
    chart.classList.add('clickable');
    return chart;
  }, 1160);
}
