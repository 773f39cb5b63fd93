// Tests the pages in a real browser: node pages_test.mjs HEBA SOURCE PACKAGES, where PACKAGES is the folder that
// holds node_modules with playwright-core. Exits with status 77 if there is no Chromium.
import assert from 'node:assert/strict';
import {execFileSync} from 'node:child_process';
import {existsSync, mkdtempSync, readFileSync, renameSync, rmSync, writeFileSync} from 'node:fs';
import {createRequire} from 'node:module';
import {tmpdir} from 'node:os';
import {join} from 'node:path';
import {pathToFileURL} from 'node:url';

const [heba, source, packages] = process.argv.slice(2);
const executablePath = ['/usr/bin/chromium', '/usr/bin/chromium-browser', '/usr/bin/google-chrome'].find(existsSync);
if (!executablePath) {
  console.log('skipped: there is no Chromium');
  process.exit(77);
}
const {chromium} = createRequire(`${packages}/`)('playwright-core');

// A file name that would do harm if it became markup. (File names cannot contain the slash that would close an
// element.)
const kHostile = '<img src=x onerror=window.harmed=1>.png';
const kSwallowing = '<!--<script>.png'; // Would swallow the rest of the page.

const folder = mkdtempSync(join(tmpdir(), 'heba_pages_'));
process.env.HEBA_CACHE = join(folder, 'cache');
const run = (...args) => execFileSync(heba, args, {cwd: folder, stdio: ['ignore', 'pipe', 'pipe']});

function makePages() {
  run('simulate', join(source, 'configs/sample_scene.yaml'), '--out', 'data', '--set', 'motion.captures=10', '--quiet');
  const poses = readFileSync(join(folder, 'data/poses.csv'), 'utf8');
  assert.ok(poses.includes('003.png'));
  renameSync(join(folder, 'data/images/003.png'), join(folder, 'data/images', kHostile));
  renameSync(join(folder, 'data/images/006.png'), join(folder, 'data/images', kSwallowing));
  writeFileSync(join(folder, 'data/poses.csv'), poses.replace('003.png', kHostile).replace('006.png', kSwallowing));
  writeFileSync(join(folder, 'noisy.yaml'), 'base: data/config.yaml\nrefine: {robot_noise: {translation: 0.05 mm, rotation: 0.01 deg}}\n');
  writeFileSync(join(folder, 'exact.yaml'), 'base: data/config.yaml\n');
  writeFileSync(join(folder, 'long.yaml'), 'base: data/config.yaml\nname: cell_7_line_2_with_a_very_long_name_indeed\n');
  run('run', 'exact.yaml', 'noisy.yaml', 'long.yaml', '--out', 'runs', '--quiet');
  run('compare', 'runs', '--out', 'comparison', '--quiet');
  const scene = readFileSync(join(source, 'configs/rig/scene.yaml'), 'utf8');
  writeFileSync(join(folder, 'rig.yaml'), scene.replace(/captures: *[0-9]+/, 'captures: 12'));
  writeFileSync(join(folder, 'rig_arm.yaml'), 'base: rig.yaml\nrobot: {model: ur10e, offsets: 0.05 deg, lengths: 0.3 mm, ' +
                'angles: 0.03 deg, configurations: one, record_joints: true}\nrobot_noise: {translation: 0.02 mm, rotation: 0.004 deg}\n');
  run('simulate', 'rig_arm.yaml', '--out', 'rig_arm', '--quiet');
  run('run', 'rig_arm/config.yaml', '--out', 'rig_arm_run', '--quiet');
  writeFileSync(join(folder, 'one_condition.yaml'), 'trials: 2\nscenes: {cell: rig.yaml}\nshape_model: none\n');
  run('study', 'one_condition.yaml', '--out', 'one_condition', '--quiet');
  writeFileSync(join(folder, 'study.yaml'),
                `trials: 4\nseed: 1\nscenes: {small: ${join(source, 'configs/scenes/ring4_eye_to_hand.yaml')}}\n` +
                'pixel_noise: [0.1 px, 0.5 px]\n');
  run('study', 'study.yaml', '--out', 'study', '--quiet');
}

// Opens a tab, in which all files are opened one after the other.
async function openTab(browser, width, options) {
  const context = await browser.newContext({viewport: {width, height: 900}, offline: true, ...options});
  return context.newPage();
}

// Opens a file, and collects the browser's complaints about it while it is open.
async function open(page, file, complaints) {
  page.removeAllListeners();
  page.on('console', (message) => {
    if (['error', 'warning'].includes(message.type())) complaints.push(`${file}: console: ${message.text()}`);
  });
  page.on('pageerror', (error) => complaints.push(`${file}: ${error.message}`));
  page.on('request', (request) => {
    const url = request.url();
    if (url !== pathToFileURL(join(folder, file)).href && !url.startsWith('data:')) complaints.push(`${file}: asks for ${url}`);
  });
  await page.goto(pathToFileURL(join(folder, file)).href);
}

// Selector of the marks of each view, and the minimum number of marks in these runs.
const kMarks = {
  'set-up': ['svg.scene path', 10],
  dumbbells: ['g[aria-label=dot] circle', 4],
  'residual-field': ['g[aria-label=dot] circle', 200],
  coverage: ['g[aria-label=rect] rect', 48],
  'residual-radius': ['g[aria-label=dot] circle', 200],
  'capture-bars': ['g[aria-label=bar] rect', 9],
  histogram: ['g[aria-label=rect] rect', 41],
  ellipses: ['g[aria-label=line] path', 8],
  correlation: ['g[aria-label=cell] rect', 12 * 12],
  'arm-corrections': ['g[aria-label=dot] circle', 10],
  'arm-map': ['g[aria-label=rect] rect', 400],
  lines: ['g[aria-label=line] path', 2],
  pairs: ['g[aria-label=cell] rect', 2],
};

async function checkFigures(page, file, width, views) {
  const figures = await page.$$eval('figure[data-view]', (all, marks) => all.map((figure) => {
    const box = (figure.querySelector('svg.scene') ?? figure.querySelector('.drawing svg'))?.getBoundingClientRect();
    return {
      view: figure.dataset.view, drawn: figure.dataset.drawn, width: box?.width ?? 0, height: box?.height ?? 0, right: box?.right ?? 0,
      marks: figure.querySelectorAll(marks[figure.dataset.view][0]).length};
  }), kMarks);
  for (const view of views) assert.ok(figures.some((figure) => figure.view === view), `${file} has no ${view}`);
  for (const figure of figures) {
    assert.equal(figure.drawn, 'true', `${file}: ${figure.view}`);
    assert.ok(figure.width > 80 && figure.height > 40 && figure.right <= width + 1, `${file}: ${JSON.stringify(figure)}`);
    assert.ok(figure.marks >= kMarks[figure.view][1], `${file}: ${JSON.stringify(figure)}`);
  }
  assert.ok(await page.evaluate(() => document.documentElement.scrollWidth) <= width, `${file} is wider than ${width} px`);
  const cut = await page.$$eval('.drawing text', (texts) =>
      texts.filter((text) => !text.closest('.scene') && text.getBoundingClientRect().left < -1).map((text) => text.textContent));
  assert.deepEqual(cut, [], `${file}: labels are cut off`);
}

async function column(page, table, index) {
  return page.$$eval('table', (tables, [t, i]) => [...tables[t].tBodies[0].rows].map((row) => row.cells[i].textContent), [table, index]);
}

// Checks that numbers ascend, then descend, and that empty cells stay last.
async function checkSorting(page, title, width) {
  const place = await page.$$eval('table', (tables, wanted) => {
    for (const [t, table] of tables.entries()) {
      const i = [...table.tHead.rows[0].cells].findIndex((cell) => cell.textContent === wanted);
      if (i >= 0) return [t, i];
    }
    return null;
  }, title);
  assert.ok(place, `no column '${title}'`);
  const before = await column(page, ...place);
  const head = page.locator('table').nth(place[0]).locator('th').nth(place[1]);
  // A narrow window has a choice in place of the headings, which every row repeats.
  const choice = page.locator('table').nth(place[0]).locator('xpath=..').locator('.sort-choice select');
  assert.equal(await head.isVisible(), width > 400, `${title}: heading`);
  for (const sign of [1, -1]) {
    if (width > 400) await head.click();
    else await choice.selectOption({label: `${title} ${sign > 0 ? '\u2191' : '\u2193'}`});
    const after = await column(page, ...place);
    assert.deepEqual([...after].sort(), [...before].sort());
    const numbers = after.filter((text) => text !== '').map(Number);
    assert.ok(numbers.length > 1 && numbers.every((value, i) => i === 0 || sign * (value - numbers[i - 1]) >= 0), `${title}: ${after}`);
    assert.equal(await head.getAttribute('aria-sort'), sign > 0 ? 'ascending' : 'descending');
  }
}

// Returns the paths of the scene, rounded to a hundredth of a pixel.
const sceneOf = (page) => page.$$eval('svg.scene path', (paths) => paths.map((path) => path.getAttribute('d')
    .replace(/-?[0-9.]+(e-?[0-9]+)?/g, (number) => String(Number(Number(number).toFixed(2)) + 0))).join(' '));

async function checkScene(page) {
  const scene = page.locator('svg.scene');
  await scene.scrollIntoViewIfNeeded();
  const box = await scene.boundingBox();
  const first = await sceneOf(page);
  assert.ok(first.length > 500 && !first.includes('NaN'));
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
  await page.mouse.down();
  await page.mouse.move(box.x + box.width / 2 + 60, box.y + box.height / 2 + 10, {steps: 4});
  await page.mouse.up();
  const dragged = await sceneOf(page);
  assert.notEqual(dragged, first, 'a drag does not turn the scene');
  await scene.focus();
  await page.keyboard.press('ArrowLeft');
  assert.notEqual(await sceneOf(page), dragged, 'a key does not turn the scene');
  await page.getByRole('button', {name: 'reset the view'}).click();
  assert.equal(await sceneOf(page), first, 'the view is not reset');
  // No label is cut off.
  const [edge, names] = await page.evaluate(() => {
    const inside = document.querySelector('svg.scene').getBoundingClientRect();
    return [inside.right, [...document.querySelectorAll('svg.scene text')].map((text) => text.getBoundingClientRect().right)];
  });
  assert.ok(names.length === 4 && names.every((right) => right <= edge), `${names} reach beyond ${edge}`);
}

// Checks that all parts of the cell of a rig are named, also at another capture, and that no name covers another.
async function checkCell(page) {
  const namesIn = () => page.$$eval('svg.scene text', (texts) => texts.map((text) => text.textContent).sort());
  const wanted = ['base', 'gripper', 'left', 'plate', 'right', 'wall', 'wrist'];
  assert.deepEqual(await namesIn(), wanted);
  const first = await sceneOf(page);
  await page.locator('figure[data-view=set-up] input[type=range]').fill('1');
  assert.notEqual(await sceneOf(page), first, 'the choice of the capture changes nothing');
  assert.deepEqual(await namesIn(), wanted);
  assert.ok((await page.locator('figure[data-view=set-up] output').textContent()).includes('2: 001.png'));
  const covered = await page.$$eval('svg.scene text', (texts) => {
    const boxes = texts.map((text) => [text.textContent, text.getBoundingClientRect()]);
    return boxes.flatMap(([a, x], i) => boxes.slice(i + 1).filter(([, y]) =>
        x.left < y.right && y.left < x.right && Math.abs(x.top - y.top) < 8).map(([b]) => `${a} ${b}`));
  });
  assert.deepEqual(covered, []);
}

// Checks that residuals of a rig agree with the noise of the pixels, and that the dialog names the camera.
async function checkRigResiduals(page) {
  for (const camera of [0, 1, 2]) {
    const share = await page.evaluate((id) => {
      const {captures, sigma_px: sigma} = JSON.parse(document.getElementById(id).textContent);
      const residuals = captures.flatMap(({points}) => points.filter((_, i) => i % 4 > 1));
      return residuals.filter((value) => Math.abs(value) > 2 * sigma).length / residuals.length;
    }, `captures_${camera}`);
    assert.ok(share > 0.005 && share < 0.1, `camera ${camera}: ${share} of the residuals are beyond two sigma`);
  }
  const bar = page.locator('figure[data-view=capture-bars]').nth(2).locator('g[aria-label=bar] rect').nth(1);
  await bar.scrollIntoViewIfNeeded();
  await bar.hover();
  await bar.click();
  const dialog = page.locator('dialog[open]');
  const title = await dialog.locator('h3').textContent();
  assert.ok(title.startsWith('camera wrist, image 2: 001.png, target'), title);
  // Magnified residuals are clipped at the edge of the image.
  assert.equal(await dialog.locator('svg svg').evaluate((inside) => getComputedStyle(inside).overflow), 'hidden');
  await dialog.getByRole('button', {name: 'close'}).click();
  // The row of an image opens it too.
  await page.locator('tr[data-from=captures_1]').nth(3).click();
  const ofRow = await dialog.locator('h3').textContent();
  assert.ok(ofRow.startsWith('camera right, image 4: 003.png, target'), ofRow);
  await dialog.getByRole('button', {name: 'close'}).click();
}

async function checkCaptures(page) {
  const row = page.locator('tr[data-capture]', {hasText: kHostile});
  assert.equal(await row.count(), 1);
  await row.click();
  const dialog = page.locator('dialog[open]');
  assert.equal(await dialog.locator('h3').textContent(), `4: ${kHostile}`);
  const picture = await dialog.locator('image').getAttribute('href');
  const size = await page.evaluate(async (href) => {
    const image = new Image();
    image.src = href;
    await image.decode();
    return [image.naturalWidth, image.naturalHeight];
  }, picture);
  assert.deepEqual(size, [640, 480]);
  const ends = () => dialog.locator('line.arrow').evaluateAll((lines) => lines.map((line) => line.getAttribute('x2')).join());
  const before = await ends();
  assert.ok(before.split(',').length >= 20, 'few residuals are drawn');
  await dialog.locator('input[type=range]').fill('0.8');
  assert.notEqual(await ends(), before, 'the slider does not stretch the residuals');
  const names = [`4: ${kHostile}`];
  for (const act of [() => dialog.getByRole('button', {name: 'next'}).click(), () => page.keyboard.press('ArrowRight'),
                     () => page.keyboard.press('ArrowRight')]) {
    await act();
    names.push(await dialog.locator('h3').textContent());
  }
  assert.deepEqual(names, [`4: ${kHostile}`, '5: 004.png', '6: 005.png', `7: ${kSwallowing}`]);
  await page.keyboard.press('Escape');
  assert.equal(await page.locator('dialog[open]').count(), 0);
  // A bar of the chart opens the capture too.
  const bar = page.locator('figure[data-view=capture-bars] g[aria-label=bar] rect').nth(4);
  await bar.scrollIntoViewIfNeeded();
  await bar.hover();
  await bar.click();
  assert.equal(await page.locator('dialog[open] h3').textContent(), '5: 004.png');
  await page.locator('dialog[open]').getByRole('button', {name: 'close'}).click();
  assert.equal(await page.locator('dialog[open]').count(), 0);
}

const kReportViews = ['set-up', 'dumbbells', 'residual-field', 'coverage', 'residual-radius', 'histogram', 'capture-bars', 'ellipses', 'correlation'];
const kPages = [
  {file: 'runs/exact/report.html', views: kReportViews, column: 'rms, px', isReport: true},
  {file: 'runs/noisy/report.html', views: kReportViews, column: 'robot correction, mm', isReport: true},
  {file: 'runs/summary.html', views: ['dumbbells'], column: 'hold-out, px'},
  {file: 'comparison/compare.html', views: ['dumbbells', 'pairs'], column: 'sigma, mm'},
  {file: 'study/study.html', views: ['lines'], column: 'hand-eye, mm'},
  {file: 'rig_arm_run/report.html', views: [...kReportViews.filter((view) => view !== 'dumbbells'), 'arm-corrections', 'arm-map'],
   column: 'hold-out, px', isRig: true},
  {file: 'one_condition/study.html', views: ['dumbbells'], column: 'error, mm'},
];

// Checks that the errors of the bound and every method come first, then the coverage with its band.
async function checkStudy(page) {
  const charts = page.locator('figure[data-view=lines]');
  assert.equal(await charts.count(), 2);
  assert.ok((await charts.nth(0).locator('g[aria-label=line] path').count()) >= 5, 'few methods in the chart of errors');
  assert.ok((await charts.nth(0).locator('.legend').textContent()).includes('bound'));
  assert.equal(await charts.nth(1).locator('g[aria-label=rect] rect').count(), 1, 'the coverage has no band');
}

// Checks the section on an arm whose errors were estimated, and that its table can be opened.
async function checkArm(page) {
  const section = page.locator('section', {has: page.locator('h2', {hasText: 'Kinematics of arm robot'})});
  assert.match(await section.locator('p').first().textContent(), /ur10e were estimated .*the noise of its poses falls from .* to /);
  await section.locator('summary').click();
  assert.ok((await section.locator('tbody tr').count()) >= 10, 'few parameters in the table of the arm');
  assert.ok((await section.textContent()).includes('Not determined'), 'the undetermined parameters are not named');
}

// Checks that no table cell exceeds a narrow window.
async function checkNarrow(page, file) {
  const outside = await page.$$eval('td', (cells) => cells.filter((cell) => cell.getBoundingClientRect().right > innerWidth + 1)
      .map((cell) => cell.textContent));
  assert.deepEqual(outside, [], `${file}: cells outside of the window`);
}

// Checks that without a script the page says that it has no charts, and shows its tables.
async function checkWithoutScript(page, file) {
  await page.goto(pathToFileURL(join(folder, file)).href);
  assert.ok(await page.locator('noscript p').isVisible(), `${file} does not say why it has no charts`);
  // A photograph needs no script.
  assert.equal(await page.locator('figure:not(.photograph) svg').count(), 0);
  const rows = page.locator('tbody tr');
  assert.ok((await rows.count()) > 0 && (await rows.first().boundingBox()), `${file} shows no table`);
}

// Checks that the record fits on the first printed page. It resizes the window.
async function checkRecord(page, file) {
  await page.emulateMedia({media: 'print'});
  // US Letter, which is shorter than A4, without margins, in px.
  await page.setViewportSize({width: 816 - 90, height: 1056});
  const height = await page.locator('.record-page').evaluate((element) => element.getBoundingClientRect().height);
  assert.ok(height < 1056 - 90, `${file}: the record is ${height} px high`);
  await page.emulateMedia({media: 'screen'});
}

let browser;
try {
  makePages();
  const args = ['--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run', '--disable-background-networking',
                '--disable-component-update', '--disable-sync'];
  browser = await chromium.launch({executablePath, args});
  const complaints = [];
  const plain = await openTab(browser, 1280, {javaScriptEnabled: false});
  const tabs = [[1280, await openTab(browser, 1280)], [400, await openTab(browser, 400)]];
  for (const {file, views, column: title, isReport, isRig} of kPages) {
    await checkWithoutScript(plain, file);
    for (const [width, page] of tabs) {
      await page.setViewportSize({width, height: 900});
      await open(page, file, complaints);
      await checkFigures(page, file, width, views);
      await checkSorting(page, title, width);
      if (isRig) {
        await checkCell(page);
        await checkRigResiduals(page);
        await checkArm(page);
      }
      if (file.startsWith('study')) await checkStudy(page);
      if (width === 400) await checkNarrow(page, file);
      if (isReport) {
        await checkScene(page);
        await checkCaptures(page);
      }
      assert.equal(await page.evaluate(() => window.harmed), undefined, `${file}: a name became markup`);
      assert.equal(await page.locator('img').count(), 0);
      // The page adapts to dark colours and to print.
      await page.emulateMedia({colorScheme: 'dark'});
      const dark = await page.evaluate(() => getComputedStyle(document.body).backgroundColor);
      await page.emulateMedia({colorScheme: 'light'});
      assert.notEqual(await page.evaluate(() => getComputedStyle(document.body).backgroundColor), dark);
      await page.emulateMedia({media: 'print', colorScheme: 'dark'});
      assert.equal(await page.evaluate(() => getComputedStyle(document.body).backgroundColor), 'rgb(255, 255, 255)');
      if (isReport) assert.equal(await page.locator('.hint').isVisible(), false);
      await page.emulateMedia({media: 'screen', colorScheme: 'light'});
      // The content security policy allows only the page's own script.
      await page.evaluate(() => {
        const script = document.createElement('script');
        script.textContent = 'window.harmed = 2';
        document.body.append(script);
        const button = document.createElement('button');
        button.setAttribute('onclick', 'window.harmed = 3');
        document.body.append(button);
        button.click();
      });
      assert.equal(await page.evaluate(() => window.harmed), undefined, 'a script from elsewhere runs');
      const refusals = complaints.filter((text) => text.includes('Content Security Policy'));
      assert.equal(refusals.length, 2, String(complaints));
      complaints.splice(0, complaints.length, ...complaints.filter((text) => !refusals.includes(text)));
      if (isReport && width > 400) await checkRecord(page, file);
      console.log(`${file} at ${width} px: ok`);
    }
  }
  assert.deepEqual(complaints, []);
} finally {
  await browser?.close();
  rmSync(folder, {recursive: true, force: true});
}
