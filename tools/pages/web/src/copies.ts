// Adds a copy button to text that is meant to be copied.
import {element} from './figure';

// Selects the text if the clipboard is not available, e.g. in some mail programs.
async function copy(source: HTMLElement): Promise<string> {
  try {
    await navigator.clipboard.writeText(source.textContent ?? '');
    return 'copied';
  } catch {
    getSelection()?.selectAllChildren(source);
    return document.execCommand('copy') ? 'copied' : 'selected';
  }
}

export function prepareCopies(): void {
  for (const source of document.querySelectorAll<HTMLElement>('.copyable')) {
    const place = element('div', 'copy-place');
    const button = element('button', '', 'copy');
    button.type = 'button';
    button.addEventListener('click', async () => {
      button.textContent = await copy(source);
      setTimeout(() => { button.textContent = 'copy'; }, 1500);
    });
    source.replaceWith(place);
    place.append(source, button);
  }
}
