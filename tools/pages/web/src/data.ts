// What the pages hold for the views: written by tools/pages/report.cc, tools/pages/summary.cc, tools/pages/comparison.cc and
// tools/study/study_report.cc. Lengths in m unless a name says otherwise; a figure that does not exist is null.

// b_from_a.
export interface Pose {
  t: [number, number, number];
  q: [number, number, number, number]; // x y z w
}

export interface Capture {
  image: string;
  used: boolean;
  reason: string;
  rms_px: number | null;
  // x, y, predicted minus seen in x and in y; px, point after point: of those that count, and of the others.
  points: number[];
  left_out: number[];
  // A small copy, JPEG as base64.
  picture: string | null;
}

export interface Captures {
  image_size: [number, number];
  centre: [number, number]; // The principal point.
  rms_px: number | null; // Of all points that count.
  sigma_px: number; // The noise of a coordinate.
  captures: Capture[];
}

export interface SetUp {
  setup: 'eye_to_hand' | 'eye_in_hand';
  mount_from_camera: Pose;
  mount_from_target: Pose;
  corners: [number, number, number][]; // The rays of the picture's corners, from the upper left on clockwise, in the camera.
  target_size: [number, number, number, number]; // x and y from, x and y to.
  captures: {image: string; number: number; used: boolean; base_from_gripper: Pose}[];
}

export interface Dumbbells {
  unit: string;
  series: string[];
  rows: {label: string; values: (number | null)[]; strong?: boolean}[];
}

export interface Lines {
  x_label: string;
  y_label: string;
  linear?: ('x' | 'y')[]; // The axes that are not logarithmic.
  band?: [number, number]; // The part of the vertical axis that is as it should be.
  lines: {name: string; reference: boolean; strong: boolean; points: [number, number][]}[];
}

export interface Ellipses {
  // covariance: xx, xy, yy. reach_95: the axes of the region that holds the truth with 95 %, in sigmas.
  ellipses: {x_label: string; y_label: string; unit: string; covariance: [number, number, number]; reach_95: number}[];
}

export interface Correlation {
  names: string[];
  matrix: (number | null)[][];
}

export interface Pairs {
  runs: string[];
  pairs: {first: number; second: number; mm: number; deg: number; sigma_mm: number; sigma_deg: number; chance: number}[];
}
