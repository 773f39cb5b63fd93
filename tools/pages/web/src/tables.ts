// Sorts a table by the column whose heading is clicked: numbers by value, empty cells last. A click on the row of a
// capture opens the capture.
import type {Captures} from './data';
import {openCapture} from './capture_dialog';
import {dataIn} from './page_data';

// Returns the number in a cell such as "0.8 mm" or "< 1e-6".
const numberOf = (text: string) => Number.parseFloat(text.replace('< ', ''));

function sortBy(head: HTMLTableCellElement): void {
  const body = head.closest('table')?.tBodies[0];
  if (!body) return;
  const column = head.cellIndex;
  const isUp = head.getAttribute('aria-sort') !== 'ascending';
  for (const other of head.parentElement?.children ?? []) other.removeAttribute('aria-sort');
  head.setAttribute('aria-sort', isUp ? 'ascending' : 'descending');
  const keys = [...body.rows].map((row) => {
    const cell = row.cells[column];
    return {row, text: cell?.textContent ?? '', isNumber: cell?.className === 'number'};
  });
  const isEmpty = (text: string) => text === '' || text === '-';
  keys.sort((a, b) => {
    if (isEmpty(a.text) || isEmpty(b.text)) return Number(isEmpty(a.text)) - Number(isEmpty(b.text));
    const difference = a.isNumber && b.isNumber ? numberOf(a.text) - numberOf(b.text) :
                                                  a.text.localeCompare(b.text, 'en', {numeric: true});
    return isUp ? difference : -difference;
  });
  body.append(...keys.map(({row}) => row));
}

// Returns the choice of the column to sort by, which stands in for the headings in a narrow window.
function sortChoice(heads: HTMLTableCellElement[]): HTMLElement {
  const label = document.createElement('label');
  label.className = 'sort-choice';
  const choice = document.createElement('select');
  choice.append(new Option('order', ''));
  for (const sign of ['\u2191', '\u2193']) {
    heads.forEach((head, i) => {
      const name = head.textContent ?? '';
      if (name) choice.append(new Option(`${name} ${sign}`, `${i} ${sign}`));
    });
  }
  choice.addEventListener('change', () => {
    const [index, sign] = choice.value.split(' ');
    const head = heads[Number(index)];
    if (!choice.value || !head) return;
    if (sign === '\u2193') head.setAttribute('aria-sort', 'ascending');
    else head.removeAttribute('aria-sort');
    sortBy(head);
  });
  label.append('sort by ', choice);
  return label;
}

export function prepareTables(): void {
  const kFewRows = 3;
  for (const table of document.querySelectorAll<HTMLTableElement>('.wide table')) {
    if ((table.tBodies[0]?.rows.length ?? 0) < kFewRows) continue;
    table.before(sortChoice([...table.querySelectorAll<HTMLTableCellElement>('th')]));
  }
  for (const head of document.querySelectorAll<HTMLTableCellElement>('th')) {
    head.addEventListener('click', () => sortBy(head));
  }
  for (const row of document.querySelectorAll<HTMLTableRowElement>('tr[data-capture]')) {
    const script = document.getElementById(row.dataset['from'] ?? '');
    if (!script) continue;
    const data = dataIn(script) as Captures;
    const index = Number(row.dataset['capture']);
    const cell = row.cells[1]; // Name of the capture, in the cell after its number.
    if (!cell || !data.captures[index]) continue;
    const button = document.createElement('button');
    button.className = 'open';
    button.append(...cell.childNodes);
    cell.replaceChildren(button);
    row.addEventListener('click', () => openCapture(data, index));
  }
}
