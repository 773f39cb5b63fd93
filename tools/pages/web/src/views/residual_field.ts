// Draws the residuals (predicted minus observed) of all captures over the image, magnified. An error of the lens
// model shows as arrows that point the same way in one part of the image.
import {dot, frame, link, plot} from '@observablehq/plot';
import type {Captures} from '../data';
import {openCapture} from '../capture_dialog';
import {colours, magnification, magnifier, responsive, significant, typicalLength} from '../figure';

const kMaxArrows = 4000;

export interface Residual {
  capture: number;
  x: number;
  y: number;
  dx: number;
  dy: number;
}

export function residualsOf(data: Captures): Residual[] {
  const all: Residual[] = [];
  data.captures.forEach(({points}, capture) => {
    for (let i = 0; i + 3 < points.length; i += 4) {
      all.push({capture, x: points[i]!, y: points[i + 1]!, dx: points[i + 2]!, dy: points[i + 3]!});
    }
  });
  return all;
}

// Returns an evenly spaced subset of at most `most` elements.
export function thinned<T>(all: T[], most: number): T[] {
  const step = Math.ceil(all.length / most);
  return step <= 1 ? all : all.filter((_, i) => i % step === 0);
}

export function residualField(figure: HTMLElement, data: Captures): void {
  const [width, height] = data.image_size;
  const all = residualsOf(data);
  const drawn = thinned(all, kMaxArrows);
  if (drawn.length === 0) {
    figure.append('No points to show.');
    return;
  }
  let times = magnification(typicalLength(all.map(({dx, dy}) => Math.hypot(dx, dy))), width);
  const {redraw} = responsive(figure, (wide) => {
    const chart = plot({
      width: wide, height: (wide * height) / width, margin: 1,
      x: {domain: [-0.5, width - 0.5], axis: null},
      y: {domain: [height - 0.5, -0.5], axis: null},
      clip: true,
      marks: [
        link(drawn, {
          x1: 'x', y1: 'y', x2: (r: Residual) => r.x + times * r.dx, y2: (r: Residual) => r.y + times * r.dy,
          stroke: colours.second, strokeWidth: 1}),
        dot(drawn, {
          x: 'x', y: 'y', r: 1.2, fill: colours.first,
          channels: {what: {value: (r: Residual) =>
              `${r.capture + 1}: ${data.captures[r.capture]?.image}, ${significant(r.dx, 2)}, ${significant(r.dy, 2)} px`, label: ''}},
          tip: {format: {x: false, y: false, what: true}}}),
        frame({stroke: colours.dim}),
      ],
    });
    chart.addEventListener('click', () => {
      const at = (chart as unknown as {value: Residual | null}).value;
      if (at) openCapture(data, at.capture);
    });
    chart.classList.add('clickable');
    return chart;
  });
  figure.append(magnifier(times, (wanted) => {
    times = wanted;
    redraw();
  }));
}
