// Functions that all views share: drawing at the available width, colours, numbers as text.

export const colours = {
  first: 'var(--first)',
  second: 'var(--second)',
  line: 'var(--line)',
  dim: 'var(--dim)',
  ink: 'var(--ink)',
  bad: 'var(--bad)',
};

// Colours that are distinct for most kinds of colour vision (after Okabe and Ito 2008, and Tol's muted scheme).
export const palette = [
  '#0072b2', '#d55e00', '#009e73', '#cc79a7', '#e69f00', '#56b4e9', '#8a6d3b', '#6a3d9a', '#999933', '#882255',
  '#44aa99', '#dd5577',
];

export function significant(value: number | null | undefined, digits = 3): string {
  return value === null || value === undefined ? '-' : String(Number(value.toPrecision(digits)));
}

// Appends a drawing to the figure. `draw` is called with the available width, and again when the width changes.
export function responsive(figure: HTMLElement, draw: (width: number) => Element, maxWidth = 760): {redraw: () => void} {
  const place = document.createElement('div');
  place.className = 'drawing';
  figure.append(place);
  let drawn = 0;
  const redraw = () => {
    const width = Math.min(Math.floor(figure.clientWidth), maxWidth);
    if (width <= 0) return;
    drawn = width;
    place.replaceChildren(draw(width));
  };
  new ResizeObserver(() => {
    if (Math.min(Math.floor(figure.clientWidth), maxWidth) !== drawn) redraw();
  }).observe(figure);
  redraw();
  return {redraw};
}

export function element<K extends keyof HTMLElementTagNameMap>(
  tag: K, className = '', text = ''): HTMLElementTagNameMap[K] {
  const made = document.createElement(tag);
  if (className) made.className = className;
  if (text) made.textContent = text;
  return made;
}

export function legend(entries: {name: string; colour: string}[]): HTMLElement {
  const list = element('div', 'legend');
  for (const {name, colour} of entries) {
    const mark = element('i');
    mark.style.background = colour;
    const entry = element('span');
    entry.append(mark, name);
    list.append(entry);
  }
  return list;
}

// Returns the factor that magnifies arrows of `typical` length for an image of `size`: 1, 2 or 5 times a power of
// ten.
export function magnification(typical: number, size: number): number {
  const wanted = size / 40 / Math.max(typical, 1e-9);
  const power = 10 ** Math.floor(Math.log10(wanted));
  return Math.max(1, power * ([5, 2, 1].find((step) => step * power <= wanted) ?? 1));
}

// Returns a slider of magnifications around the first one.
export function magnifier(first: number, change: (times: number) => void): HTMLElement {
  const label = element('label', 'magnifier');
  const slider = element('input');
  slider.type = 'range';
  slider.min = '-1';
  slider.max = '1';
  slider.step = 'any';
  slider.value = '0';
  const said = element('output');
  const times = () => Number((first * 10 ** Number(slider.value)).toPrecision(2));
  const say = () => { said.textContent = ` \u00d7 ${times()}`; };
  slider.addEventListener('input', () => {
    say();
    change(times());
  });
  say();
  label.append('magnification ', slider, said);
  return label;
}

// Returns the length for which arrows are magnified: the median or, if a part of the lengths is much larger, a third of
// their 95th percentile, so that these do not cover the image. Normal noise has the ratio 2.1.
export function typicalLength(lengths: number[]): number {
  const sorted = [...lengths].sort((a, b) => a - b);
  const at = (share: number) => sorted[Math.floor(share * sorted.length)] ?? 0;
  return Math.max(at(0.5), at(0.95) / 3);
}
