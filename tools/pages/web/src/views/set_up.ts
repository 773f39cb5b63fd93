// Draws the setup in 3-D. A few hundred lines of SVG need no graphics card, print sharp and follow the colours of the
// page, and also work in a mail program or on a remote desktop.
import {
  BufferGeometry, Color, Float32BufferAttribute, Group, LineBasicMaterial, LineSegments, Matrix4, PerspectiveCamera,
  Quaternion, Scene, Vector3,
} from 'three';
import {OrbitControls} from 'three/addons/controls/OrbitControls.js';
import {SVGObject, SVGRenderer} from 'three/addons/renderers/SVGRenderer.js';
import type {Mounted, Pose, SetUp} from '../data';
import {element, legend} from '../figure';

const kMaxCaptures = 120;
const kAxes = ['#d1242f', '#2e8b57', '#3b7dd8'];

const matrixOf = ({t, q}: Pose) => new Matrix4().compose(new Vector3(...t), new Quaternion(...q), new Vector3(1, 1, 1));

interface Style {
  colour: string; // Custom property of the page, or a colour.
  opacity: number;
  width: number;
}

// A set of lines and labels that can be replaced.
class Drawing {
  readonly group = new Group();
  readonly labels: {node: SVGTextElement; at: Vector3}[] = [];
  private readonly styled: {material: LineBasicMaterial; colour: string}[] = [];

  segments(points: Vector3[], style: Style): void {
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new Float32BufferAttribute(points.flatMap((p) => [p.x, p.y, p.z]), 3));
    const material = new LineBasicMaterial({transparent: style.opacity < 1, opacity: style.opacity, linewidth: style.width});
    this.styled.push({material, colour: style.colour});
    this.group.add(new LineSegments(geometry, material));
  }

  axes(frame: Matrix4, length: number, style: Omit<Style, 'colour'>): void {
    const at = (x: number, y: number, z: number) => new Vector3(x, y, z).applyMatrix4(frame);
    const ends = [at(length, 0, 0), at(0, length, 0), at(0, 0, length)];
    ends.forEach((end, i) => this.segments([at(0, 0, 0), end], {...style, colour: kAxes[i]!}));
  }

  // Draws a dashed line between two positions.
  link(from: Vector3, to: Vector3, style: Style): void {
    const count = 9;
    const points: Vector3[] = [];
    for (let i = 0; i < count; ++i) {
      points.push(from.clone().lerp(to, i / count), from.clone().lerp(to, (i + 0.5) / count));
    }
    this.segments(points, style);
  }

  label(text: string, at: Vector3): void {
    const node = document.createElementNS('http://www.w3.org/2000/svg', 'text');
    node.textContent = text;
    node.setAttribute('dx', '6');
    node.setAttribute('dy', '-4');
    const object = new SVGObject(node);
    object.position.copy(at);
    this.labels.push({node, at});
    this.group.add(object as unknown as Group);
  }

  // Applies the current colours of the page, light or dark.
  colour(): void {
    const style = getComputedStyle(document.documentElement);
    for (const {material, colour} of this.styled) {
      material.color = new Color(colour.startsWith('--') ? style.getPropertyValue(colour).trim() : colour);
    }
  }
}

function frustum(corners: SetUp['cameras'][number]['corners'], frame: Matrix4, depth: number): Vector3[] {
  // The rays end at the same depth, except for those at a large angle to the optical axis.
  const ends = corners.map(([x, y, z]) => new Vector3(x, y, z).multiplyScalar(depth / Math.max(z, 0.3)));
  const [leftTop, rightTop, rightBottom] = ends as [Vector3, Vector3, Vector3];
  // A roof marks the upper side of the image.
  const up = rightTop.clone().sub(rightBottom).multiplyScalar(0.15);
  const roof = leftTop.clone().add(rightTop).multiplyScalar(0.5).add(up);
  const eye = new Vector3();
  const segments = [leftTop, roof, roof, rightTop];
  ends.forEach((end, i) => segments.push(eye, end, end, ends[(i + 1) % 4]!));
  return segments.map((point) => point.clone().applyMatrix4(frame));
}

function board([x1, y1, x2, y2]: SetUp['targets'][number]['size'], frame: Matrix4): Vector3[] {
  const at = (x: number, y: number) => new Vector3(x, y, 0).applyMatrix4(frame);
  const corners = [at(x1, y1), at(x2, y1), at(x2, y2), at(x1, y2)];
  const segments: Vector3[] = [];
  corners.forEach((corner, i) => segments.push(corner, corners[(i + 1) % 4]!));
  // A line from the corner at the origin to the middle shows the orientation of the target.
  return [...segments, corners[0]!, at((x1 + x2) / 2, (y1 + y2) / 2)];
}

// Moves labels that would cover each other downwards, the upper ones first.
function separate(labels: Drawing['labels'], eye: PerspectiveCamera, width: number, height: number): void {
  const [kLetter, kLine, kRise] = [6.5, 13, -4];
  const boxes = labels
      .map(({node, at}) => {
        const seen = at.clone().project(eye);
        return {node, x: (0.5 * seen.x + 0.5) * width, y: (0.5 - 0.5 * seen.y) * height, width: kLetter * (node.textContent ?? '').length};
      })
      .sort((a, b) => a.y - b.y);
  const placed: typeof boxes = [];
  for (const box of boxes) {
    const before = box.y;
    for (const other of placed) {
      const isBeside = box.x > other.x + other.width || other.x > box.x + box.width;
      if (!isBeside && box.y < other.y + kLine && box.y > other.y - kLine) box.y = other.y + kLine;
    }
    placed.push(box);
    placed.sort((a, b) => a.y - b.y);
    box.node.setAttribute('dy', String(kRise + box.y - before));
  }
}

export function setUp(figure: HTMLElement, data: SetUp): void {
  const step = Math.ceil(data.captures.length / kMaxCaptures);
  const isDrawn = (_: unknown, i: number) => i % step === 0;
  const captures = data.captures.filter(isDrawn);
  const bases = data.arms.map(({world_from_base}) => matrixOf(world_from_base));
  const grippers = data.arms.map((arm, a) =>
    arm.grippers.filter(isDrawn).map((gripper) => bases[a]!.clone().multiply(matrixOf(gripper))));
  // The poses of a body in the world: one, or one per capture.
  const placesOf = ({arm, is_carried, mount_from_body}: Mounted) =>
    (is_carried ? grippers[arm]! : [bases[arm]!]).map((mount) => mount.clone().multiply(matrixOf(mount_from_body)));
  const cameras = data.cameras.map((camera) => ({...camera, places: placesOf(camera)}));
  const targets = data.targets.map((target) => ({...target, places: placesOf(target)}));

  // The middle and size of the scene follow from all positions.
  const place = (matrix: Matrix4) => new Vector3().setFromMatrixPosition(matrix);
  const places = [...bases, ...grippers.flat(), ...[...cameras, ...targets].flatMap((body) => body.places)].map(place);
  const low = places.reduce((a, b) => a.clone().min(b), places[0]!);
  const high = places.reduce((a, b) => a.clone().max(b), places[0]!);
  const middle = low.clone().add(high).multiplyScalar(0.5);
  const size = Math.max(high.distanceTo(low), 1e-3);

  const drawing = new Drawing();
  bases.forEach((base, a) => {
    drawing.axes(base, 0.16 * size, {opacity: 1, width: 3});
    drawing.label(data.arms[a]!.name, place(base));
  });
  const floor: Vector3[] = [];
  const ground = Math.min(0, low.z);
  const reach = 0.5 * size;
  for (let i = -4; i <= 4; ++i) {
    const offset = (reach * i) / 4;
    floor.push(new Vector3(middle.x - reach, middle.y + offset, ground), new Vector3(middle.x + reach, middle.y + offset, ground),
               new Vector3(middle.x + offset, middle.y - reach, ground), new Vector3(middle.x + offset, middle.y + reach, ground));
  }
  drawing.segments(floor, {colour: '--line', opacity: 0.8, width: 1});
  // Of the captures, one is chosen; the others are faint.
  const kFaint = 0.16;
  for (const ofArm of grippers) {
    ofArm.forEach((gripper) => drawing.axes(gripper, 0.03 * size, {opacity: 2 * kFaint, width: 1}));
  }
  const ends = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map(([x, y, z]) => new Vector3(x, y, z).multiplyScalar(0.16 * size));
  const extent = [...places, ...bases.flatMap((base) => ends.map((end) => end.clone().applyMatrix4(base)))];
  const bodies = [
    ...cameras.map((camera) => ({...camera, colour: '--second',
      lines: (at: Matrix4) => frustum(camera.corners, at, (camera.is_carried ? 0.1 : 0.18) * size)})),
    ...targets.map((target) => ({...target, colour: '--first', lines: (at: Matrix4) => board(target.size, at)})),
  ];
  for (const {places: at, is_carried, colour, lines, name, arm} of bodies) {
    for (const body of at) {
      extent.push(...lines(body));
      drawing.segments(lines(body), {colour, opacity: is_carried ? kFaint : 1, width: is_carried ? 1 : 2});
    }
    if (is_carried) continue;
    // A dashed line joins what is fixed to the base.
    drawing.link(place(bases[arm]!), place(at[0]!), {colour: '--dim', opacity: 0.8, width: 1.2});
    drawing.label(name, place(at[0]!));
  }
  // Draws the arms and what they carry at one capture.
  const drawCapture = (i: number): Drawing => {
    const drawn = new Drawing();
    bases.forEach((base, a) => {
      const gripper = grippers[a]![i]!;
      drawn.segments([place(base), place(gripper)], {colour: '--ink', opacity: 0.7, width: 2});
      drawn.axes(gripper, 0.07 * size, {opacity: 1, width: 2.5});
      drawn.label(bases.length > 1 ? `${data.arms[a]!.name}.gripper` : 'gripper', place(gripper));
    });
    for (const {places: at, is_carried, colour, lines, name, arm} of bodies) {
      if (!is_carried) continue;
      drawn.segments(lines(at[i]!), {colour, opacity: 1, width: 2});
      drawn.link(place(grippers[arm]![i]!), place(at[i]!), {colour, opacity: 1, width: 1.2});
      drawn.label(name, place(at[i]!));
    }
    return drawn;
  };

  figure.append(legend([
    {name: cameras.length > 1 ? 'cameras' : 'camera', colour: 'var(--second)'},
    {name: targets.length > 1 ? 'targets' : 'target', colour: 'var(--first)'},
    {name: bases.length > 1 ? 'from each base to its gripper' : 'from the base to the gripper', colour: 'var(--ink)'},
    // Axes of the base and of the gripper.
    {name: 'x', colour: kAxes[0]!}, {name: 'y', colour: kAxes[1]!}, {name: 'z', colour: kAxes[2]!},
  ]));

  const renderer = new SVGRenderer();
  renderer.overdraw = 0;
  const svg = renderer.domElement as unknown as SVGSVGElement;
  svg.setAttribute('tabindex', '0');
  svg.setAttribute('role', 'img');
  svg.setAttribute('aria-label', 'the setup in 3-D; drag or use the arrow keys to rotate it');
  svg.classList.add('scene');
  const frame = element('div', 'drawing');
  frame.append(svg);
  figure.append(frame);
  const reset = element('button', '', 'reset the view');
  reset.type = 'button';
  const buttons = element('div', 'view-buttons');
  const slider = element('input');
  slider.type = 'range';
  slider.min = '0';
  slider.max = String(captures.length - 1);
  // The first capture that is chosen is the used one farthest from the others, where the least is drawn over each other.
  const centres = grippers.map((ofArm) =>
    ofArm.reduce((sum, at) => sum.add(place(at)), new Vector3()).divideScalar(Math.max(1, ofArm.length)));
  const offsets = captures.map(({used}, i) =>
    (used ? grippers.reduce((sum, ofArm, a) => sum + place(ofArm[i]!).distanceTo(centres[a]!), 0) : -1));
  slider.value = String(offsets.indexOf(Math.max(...offsets)));
  const chosen = element('output');
  const choice = element('label', 'magnifier');
  choice.append('capture ', slider, chosen);
  buttons.append(reset, choice);
  figure.append(buttons);
  figure.append(element('p', 'hint', 
      'One capture is drawn in full, with the arms as straight lines and with what their grippers carry; all others are faint. ' +
      'Drag to rotate; after a click the wheel zooms and the arrow keys rotate. ' +
      'Two fingers zoom and move.' + (step > 1 ? ` ${captures.length} of ${data.captures.length} captures are drawn.` : '')));

  const eye = new PerspectiveCamera(40, 1.6, 0.01 * size, 100 * size);
  eye.up.set(0, 0, 1);
  // The initial viewpoint is beside the line between the base and the targets, slightly above, so that neither hides
  // the other.
  const work = targets.flatMap((target) => target.places).reduce((sum, at) => sum.add(place(at)), new Vector3());
  const away = new Vector3(work.y, -work.x, 0);
  if (away.lengthSq() < 1e-12) away.set(1, 0, 0);
  away.normalize().addScaledVector(work.setZ(0).normalize(), 0.45).setZ(0.55).normalize();
  const first = middle.clone().addScaledVector(away, size);
  eye.position.copy(first);
  const controls = new OrbitControls(eye, svg as unknown as HTMLElement);
  controls.target.copy(middle);
  controls.update();
  // The page scrolls as usual over the view: the wheel zooms only while the view has the focus, and vertical swipes
  // always scroll the page.
  controls.enableZoom = false;
  svg.addEventListener('focus', () => { controls.enableZoom = true; });
  svg.addEventListener('blur', () => { controls.enableZoom = false; });
  svg.addEventListener('pointerdown', () => svg.focus({preventScroll: true}));
  svg.style.touchAction = 'pan-y';
  svg.addEventListener('keydown', (event) => {
    const turn: Record<string, [number, number]> = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1]};
    const by = turn[event.key];
    if (!by) return;
    event.preventDefault();
    isUntouched = false;
    const arm = eye.position.clone().sub(controls.target);
    arm.applyAxisAngle(eye.up, 0.12 * by[0]);
    const side = new Vector3().crossVectors(eye.up, arm).normalize();
    const tilted = arm.clone().applyAxisAngle(side, 0.12 * by[1]);
    if (Math.abs(tilted.clone().normalize().dot(eye.up)) < 0.99) arm.copy(tilted);
    eye.position.copy(controls.target).add(arm);
    controls.update();
  });

  // Moves the viewpoint along its viewing direction until the whole scene just fits.
  let isUntouched = true;
  let drawnHeight = 300;
  const comeNear = () => {
    const forward = controls.target.clone().sub(eye.position).normalize();
    const right = new Vector3().crossVectors(forward, eye.up).normalize();
    const up = new Vector3().crossVectors(right, forward);
    // Labels are beside their positions and need a margin.
    const [nameWidth, nameHeight] = [56, 18];
    const half = Math.tan((0.5 * eye.fov * Math.PI) / 180);
    const slope = half * (1 - (2 * nameHeight) / drawnHeight);
    const slopeAcross = half * eye.aspect * (1 - (2 * nameWidth) / (drawnHeight * eye.aspect));
    const distances = extent.map((point) => {
      const arm = point.clone().sub(controls.target);
      const across = Math.max(Math.abs(arm.dot(right)) / slopeAcross, Math.abs(arm.dot(up)) / slope);
      return across - arm.dot(forward);
    });
    eye.position.copy(controls.target).addScaledVector(forward, -Math.max(...distances, 0.1 * size));
    controls.update();
  };

  const scene = new Scene();
  scene.add(drawing.group);
  let ofCapture = new Drawing();
  const render = () => {
    separate([...drawing.labels, ...ofCapture.labels], eye, drawnHeight * eye.aspect, drawnHeight);
    renderer.render(scene, eye);
  };
  const choose = () => {
    const index = Number(slider.value);
    scene.remove(ofCapture.group);
    ofCapture = drawCapture(index);
    ofCapture.colour();
    scene.add(ofCapture.group);
    const {name, used} = captures[index]!;
    chosen.textContent = ` ${index * step + 1}: ${name}${used ? '' : ' (not used)'}`;
  };
  slider.addEventListener('input', () => {
    choose();
    render();
  });
  const fit = () => {
    const width = Math.min(figure.clientWidth, 760);
    if (width <= 0) return;
    const height = Math.round(Math.min(0.66 * width, 480));
    renderer.setSize(width, height);
    eye.aspect = width / height;
    drawnHeight = height;
    eye.updateProjectionMatrix();
    if (isUntouched) comeNear();
    render();
  };
  const colour = () => {
    drawing.colour();
    ofCapture.colour();
    renderer.setClearColor(new Color(getComputedStyle(document.documentElement).getPropertyValue('--paper').trim()), 1);
  };
  const recolour = () => {
    colour();
    render();
  };
  choose();
  colour();
  fit();
  reset.addEventListener('click', () => {
    isUntouched = true;
    controls.target.copy(middle);
    eye.position.copy(first);
    fit();
  });
  controls.addEventListener('change', render);
  controls.addEventListener('start', () => { isUntouched = false; });
  new ResizeObserver(fit).observe(figure);
  for (const query of ['(prefers-color-scheme: dark)', 'print']) matchMedia(query).addEventListener('change', recolour);
}
