// Bundles src/main.ts and its dependencies into one script, and writes the hash by which a page allows this script
// only:
//   node bundle.mjs SCRIPT_OUT HASH_OUT
import {build} from 'esbuild';
import {createHash} from 'node:crypto';
import {readFileSync, readdirSync, writeFileSync} from 'node:fs';
import {fileURLToPath} from 'node:url';

const [scriptFile, hashFile] = process.argv.slice(2);
const here = fileURLToPath(new URL('.', import.meta.url));

// Returns the licence texts of the bundled packages, which have to accompany every copy.
function licences(inputs) {
  const packages = new Map();
  for (const input of Object.keys(inputs)) {
    const folder = input.match(/^.*node_modules\/(@[^/]+\/)?[^/]+/)?.[0];
    if (!folder || packages.has(folder)) continue;
    const {name, version} = JSON.parse(readFileSync(`${here}/${folder}/package.json`, 'utf8'));
    const file = readdirSync(`${here}/${folder}`).find((entry) => /^licen[cs]e/i.test(entry));
    packages.set(folder, {name: `${name} ${version}`, text: file ? readFileSync(`${here}/${folder}/${file}`, 'utf8').trim() : ''});
  }
  const namesOfText = new Map();
  for (const {name, text} of packages.values()) namesOfText.set(text, [...(namesOfText.get(text) ?? []), name]);
  const parts = [...namesOfText].map(([text, names]) => `${names.join(', ')}\n\n${text}`);
  return `/*\n${parts.join('\n\n----\n\n').replaceAll('*/', '* /')}\n*/\n`;
}

const result = await build({
  absWorkingDir: here,
  entryPoints: ['src/main.ts'],
  bundle: true,
  minify: true,
  charset: 'ascii',
  legalComments: 'none',
  format: 'iife',
  target: 'es2020',
  metafile: true,
  write: false,
});
// The script is pure ASCII, so that the bytes of the page match the hash whatever encoding a reader assumes.
const script = (licences(result.metafile.inputs) + result.outputFiles[0].text).replace(/[^\x00-\x7f]/g, '?');
// Inside a page these marks would end the script element or open a comment.
for (const mark of ['</script', '<!--']) {
  if (script.toLowerCase().includes(mark)) throw new Error(`the bundle contains '${mark}'`);
}
writeFileSync(scriptFile, script);
writeFileSync(hashFile, `sha256-${createHash('sha256').update(script).digest('base64')}`);
