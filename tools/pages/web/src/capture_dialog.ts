// Shows one capture: its image, the observed points, and their residuals, magnified.
import type {Captures} from './data';
import {element, magnification, magnifier, significant, typicalLength} from './figure';

const kSvg = 'http://www.w3.org/2000/svg';

function shape(name: string, attributes: Record<string, string | number>): SVGElement {
  const made = document.createElementNS(kSvg, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, String(value));
  return made;
}

// Draws the points over the image. Pixel centres are at integer coordinates, so the image begins at -0.5.
function overlay(data: Captures, index: number): HTMLElement {
  const [width, height] = data.image_size;
  const capture = data.captures[index]!;
  const whole = element('div', 'overlay');
  const svg = shape('svg', {viewBox: `-0.5 -0.5 ${width} ${height}`, role: 'img'});
  // The inner drawing clips lines that are magnified beyond the image.
  const inside = shape('svg', {x: -0.5, y: -0.5, width, height, viewBox: `-0.5 -0.5 ${width} ${height}`, overflow: 'hidden'});
  svg.append(inside);
  inside.append(shape('rect', {x: -0.5, y: -0.5, width, height, class: 'frame'}));
  if (capture.picture) {
    inside.append(shape('image', {
      x: -0.5, y: -0.5, width, height, href: `data:image/jpeg;base64,${capture.picture}`, preserveAspectRatio: 'none'}));
  }
  const unit = width / 400; // Size of thin lines and small marks, in image pixels.
  const arrows: {line: SVGElement; x: number; y: number; dx: number; dy: number}[] = [];
  const draw = (points: number[], kind: string) => {
    for (let i = 0; i + 3 < points.length; i += 4) {
      const [x, y, dx, dy] = points.slice(i, i + 4) as [number, number, number, number];
      inside.append(shape('circle', {cx: x, cy: y, r: 1.6 * unit, class: `seen ${kind}`, 'stroke-width': 0.6 * unit}));
      const line = shape('line', {x1: x, y1: y, class: 'arrow', 'stroke-width': 0.9 * unit});
      inside.append(line);
      arrows.push({line, x, y, dx, dy});
    }
  };
  draw(capture.points, 'used');
  draw(capture.left_out, 'left-out');
  const stretch = (times: number) => {
    for (const {line, x, y, dx, dy} of arrows) {
      line.setAttribute('x2', String(x + times * dx));
      line.setAttribute('y2', String(y + times * dy));
    }
  };
  whole.append(svg);
  if (arrows.length > 0) {
    const first = magnification(typicalLength(arrows.map(({dx, dy}) => Math.hypot(dx, dy))), width);
    stretch(first);
    whole.append(magnifier(first, stretch));
  }
  return whole;
}

let dialog: HTMLDialogElement | undefined;
const content = element('div');
let shown = {data: undefined as Captures | undefined, index: 0};

function show(): void {
  const {data, index} = shown;
  if (!dialog || !data) return;
  const capture = data.captures[index]!;
  const numLeftOut = capture.left_out.length / 4;
  const say = [
    capture.used ? `${capture.points.length / 4} points shown, rms ${significant(capture.rms_px)} px` : 'not used',
    ...(numLeftOut > 0 ? [`${numLeftOut} points left out (red)`] : []),
    ...(capture.reason ? [capture.reason] : []),
  ].join('; ');
  dialog.setAttribute('aria-label', capture.title);
  const parts: Node[] = [element('h3', '', capture.title), element('p', '', say)];
  if (capture.picture || capture.points.length > 0) parts.push(overlay(data, index));
  if (!capture.picture) parts.push(element('p', '', 'The page holds no image of this capture.'));
  content.replaceChildren(...parts);
}

function move(by: number): void {
  if (!shown.data) return;
  const count = shown.data.captures.length;
  shown.index = (shown.index + by + count) % count;
  show();
}

function button(text: string, className: string, act: () => void): HTMLButtonElement {
  const made = element('button', className, text);
  made.type = 'button';
  made.addEventListener('click', act);
  return made;
}

function makeDialog(): HTMLDialogElement {
  const made = element('dialog', 'capture');
  const close = button('close', 'close', () => made.close());
  close.autofocus = true;
  const buttons = element('div', 'buttons');
  // The buttons persist while the content changes, so that they keep the keyboard focus.
  buttons.append(button('\u2190 previous', '', () => move(-1)), button('next \u2192', '', () => move(1)), close);
  made.append(content, buttons);
  made.addEventListener('keydown', (event) => {
    if (event.target instanceof HTMLInputElement) return;
    if (event.key === 'ArrowLeft') move(-1);
    if (event.key === 'ArrowRight') move(1);
  });
  made.addEventListener('click', (event) => {
    if (event.target === made) made.close();
  });
  document.body.append(made);
  return made;
}

export function openCapture(data: Captures, index: number): void {
  dialog ??= makeDialog();
  shown = {data, index};
  show();
  if (!dialog.open) dialog.showModal();
}
