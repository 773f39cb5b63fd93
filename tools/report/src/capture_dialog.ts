// One capture: its picture, what was seen in it, and by how much the calibration misses that, magnified.
import type {Captures} from './data';
import {element, magnification, magnifier, median, significant} from './figure';

const kSvg = 'http://www.w3.org/2000/svg';

function shape(name: string, attributes: Record<string, string | number>): SVGElement {
  const made = document.createElementNS(kSvg, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, String(value));
  return made;
}

// The picture with the points over it. Pixel centres are whole numbers: the picture begins at -0.5.
function overlay(data: Captures, index: number): HTMLElement {
  const [width, height] = data.image_size;
  const capture = data.captures[index]!;
  const whole = element('div', 'overlay');
  const svg = shape('svg', {viewBox: `-0.5 -0.5 ${width} ${height}`, role: 'img'});
  svg.append(shape('rect', {x: -0.5, y: -0.5, width, height, class: 'frame'}));
  if (capture.picture) {
    svg.append(shape('image', {
      x: -0.5, y: -0.5, width, height, href: `data:image/jpeg;base64,${capture.picture}`, preserveAspectRatio: 'none'}));
  }
  const unit = width / 400; // What is drawn thin and small, in the picture's pixels.
  const arrows: {line: SVGElement; x: number; y: number; dx: number; dy: number}[] = [];
  const lengths: number[] = [];
  for (let i = 0; i + 3 < capture.points.length; i += 4) {
    const [x, y, dx, dy] = capture.points.slice(i, i + 4) as [number, number, number, number];
    svg.append(shape('circle', {cx: x, cy: y, r: 1.6 * unit, class: 'seen', 'stroke-width': 0.6 * unit}));
    const line = shape('line', {x1: x, y1: y, class: 'arrow', 'stroke-width': 0.9 * unit});
    svg.append(line);
    arrows.push({line, x, y, dx, dy});
    lengths.push(Math.hypot(dx, dy));
  }
  const stretch = (times: number) => {
    for (const {line, x, y, dx, dy} of arrows) {
      line.setAttribute('x2', String(x + times * dx));
      line.setAttribute('y2', String(y + times * dy));
    }
  };
  whole.append(svg);
  if (arrows.length > 0) {
    const first = magnification(median(lengths), width);
    stretch(first);
    whole.append(magnifier(first, stretch));
  }
  return whole;
}

let dialog: HTMLDialogElement | undefined;
let shown = {data: undefined as Captures | undefined, index: 0};

function show(): void {
  const {data, index} = shown;
  if (!dialog || !data) return;
  const capture = data.captures[index]!;
  const title = element('h3', '', capture.image);
  const say = capture.used ?
      `${capture.points.length / 4} points shown, rms ${significant(capture.rms_px)} px` :
      'not used';
  const about = element('p', '', say + (capture.reason ? `: ${capture.reason}` : ''));
  const buttons = element('div', 'buttons');
  const step = (text: string, by: number) => {
    const button = element('button', '', text);
    button.type = 'button';
    button.addEventListener('click', () => move(by));
    return button;
  };
  const close = element('button', 'close', 'close');
  close.type = 'button';
  close.autofocus = true;
  close.addEventListener('click', () => dialog?.close());
  buttons.append(step('\u2190 before', -1), step('next \u2192', 1), close);
  dialog.setAttribute('aria-label', capture.image);
  const parts: (Node)[] = [title, about];
  if (capture.picture || capture.points.length > 0) parts.push(overlay(data, index));
  if (!capture.picture) parts.push(element('p', '', 'The page holds no picture of this capture.'));
  dialog.replaceChildren(...parts, buttons);
}

function move(by: number): void {
  if (!shown.data) return;
  const count = shown.data.captures.length;
  shown.index = (shown.index + by + count) % count;
  show();
}

export function openCapture(data: Captures, index: number): void {
  if (!dialog) {
    dialog = element('dialog', 'capture');
    dialog.addEventListener('keydown', (event) => {
      if (event.target instanceof HTMLInputElement) return;
      if (event.key === 'ArrowLeft') move(-1);
      if (event.key === 'ArrowRight') move(1);
    });
    dialog.addEventListener('click', (event) => {
      if (event.target === dialog) dialog?.close();
    });
    document.body.append(dialog);
  }
  shown = {data, index};
  show();
  if (!dialog.open) dialog.showModal();
}
