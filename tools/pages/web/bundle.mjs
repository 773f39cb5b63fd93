// src/main.ts and all that it needs in one script, and the hash by which a page allows that script and no other:
//   node bundle.mjs SCRIPT_OUT HASH_OUT
import {build} from 'esbuild';
import {createHash} from 'node:crypto';
import {readFileSync, readdirSync, writeFileSync} from 'node:fs';
import {fileURLToPath} from 'node:url';

const [scriptFile, hashFile] = process.argv.slice(2);
const here = fileURLToPath(new URL('.', import.meta.url));

// What the bundled packages' licences ask to be kept with every copy.
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
// ASCII, so that the page's bytes are the hashed ones whatever they are read as.
const script = (licences(result.metafile.inputs) + result.outputFiles[0].text).replace(/[^\x00-\x7f]/g, '?');
// Within a page these would end the script, or begin what does not end.
for (const mark of ['</script', '<!--']) {
  if (script.toLowerCase().includes(mark)) throw new Error(`the bundle contains '${mark}'`);
}
writeFileSync(scriptFile, script);
writeFileSync(hashFile, `sha256-${createHash('sha256').update(script).digest('base64')}`);
