// The data of the page, JSON in script elements without code; each element is parsed once.
const parsed = new Map<Element, unknown>();

export function dataIn(script: Element): unknown {
  if (!parsed.has(script)) parsed.set(script, JSON.parse(script.textContent ?? ''));
  return parsed.get(script);
}
