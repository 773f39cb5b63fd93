// The page's data, each parsed once: JSON in the scripts that hold no program.
const parsed = new Map<Element, unknown>();

export function dataIn(script: Element): unknown {
  if (!parsed.has(script)) parsed.set(script, JSON.parse(script.textContent ?? ''));
  return parsed.get(script);
}
