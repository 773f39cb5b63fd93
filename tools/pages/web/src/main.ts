// Charts are drawn with Observable Plot: its SVG prints sharp and follows the colours of the page, and it has marks
// for vectors, cells and dumbbells, logarithmic axes and tooltips. It adds a quarter of a megabyte to every page;
// Plotly would add three and a half, and uPlot, the smallest, has neither vector fields nor cell matrices. 3-D scenes
// are drawn with three.js, also as SVG.
//
// This script finds the figures of the page and draws each with its view: <figure data-view="NAME"> has its data as
// JSON in a script element of its own, or in the one that data-from names.
import {dataIn} from './page_data';
import {prepareCopies} from './copies';
import {prepareTables} from './tables';
import {armCorrections} from './views/arm_corrections';
import {armMap} from './views/arm_map';
import {captureBars} from './views/capture_bars';
import {correlation} from './views/correlation';
import {coverage} from './views/coverage';
import {dumbbells} from './views/dumbbells';
import {ellipses} from './views/ellipses';
import {histogram} from './views/histogram';
import {lines} from './views/lines';
import {pairs} from './views/pairs';
import {residualField} from './views/residual_field';
import {residualRadius} from './views/residual_radius';
import {setUp} from './views/set_up';

const views: Record<string, (figure: HTMLElement, data: any) => void> = {
  'arm-corrections': armCorrections,
  'arm-map': armMap,
  'capture-bars': captureBars,
  correlation,
  coverage,
  dumbbells,
  ellipses,
  histogram,
  lines,
  pairs,
  'residual-field': residualField,
  'residual-radius': residualRadius,
  'set-up': setUp,
};

function dataOf(figure: HTMLElement): unknown {
  const from = figure.dataset['from'];
  const script = from ? document.getElementById(from) : figure.querySelector('script');
  if (!script) throw new Error('has no data');
  return dataIn(script);
}

for (const figure of document.querySelectorAll<HTMLElement>('figure[data-view]')) {
  const name = figure.dataset['view'] ?? '';
  try {
    const view = views[name];
    if (!view) throw new Error('is not known');
    view(figure, dataOf(figure));
    figure.dataset['drawn'] = 'true';
  } catch (error) {
    figure.append(`This chart could not be drawn (${String(error)}).`);
    console.error(`view '${name}':`, error);
  }
}
prepareTables();
prepareCopies();
