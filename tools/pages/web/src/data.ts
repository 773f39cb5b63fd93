// The data that pages hold for the views. It is written by tools/pages/report.cc, residual_sections.cc, summary.cc,
// arm_section.cc and comparison.cc, and tools/study/study_page.cc. Lengths are in m unless a name says otherwise; a missing
// figure is null.

// A transform b_from_a.
export interface Pose {
  t: [number, number, number];
  q: [number, number, number, number]; // Quaternion x y z w.
}

export interface Capture {
  image: string;
  title: string; // The title of the dialog.
  used: boolean;
  reason: string;
  rms_px: number | null;
  // Four numbers for each point: x, y, residual (predicted minus observed) in x and in y, px; of the inliers and of
  // the points that were left out.
  points: number[];
  left_out: number[];
  // Downscaled image, JPEG as base64.
  picture: string | null;
}

export interface Captures {
  image_size: [number, number];
  centre: [number, number]; // The principal point.
  rms_px: number | null; // RMS over all inliers.
  sigma_px: number; // Pixel noise, one sigma of a coordinate.
  captures: Capture[];
}

// A camera or target, on the base or on the gripper of an arm.
export interface Mounted {
  name: string;
  arm: number;
  is_carried: boolean;
  mount_from_body: Pose;
}

export interface SetUp {
  arms: {name: string; world_from_base: Pose; grippers: Pose[]}[]; // grippers: base_from_gripper at each capture.
  // Rays of the image corners in the camera frame, clockwise from the upper left.
  cameras: (Mounted & {corners: [number, number, number][]})[];
  targets: (Mounted & {size: [number, number, number, number]})[]; // Minimum x and y, maximum x and y.
  captures: {name: string; used: boolean}[];
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
  band?: [number, number]; // Expected range of the values on the vertical axis.
  lines: {name: string; reference: boolean; strong: boolean; points: [number, number][]}[];
}

export interface Ellipses {
  // `covariance` is xx, xy, yy. `reach_95` is the size of the region that holds the truth with probability 95 %, in
  // sigmas.
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

export interface ArmCorrections {
  panels: {unit: string; names: string[]; values: number[]; sigmas: number[]}[];
}

export interface ArmMaps {
  x: [number, number]; // The range of the horizontal axis, mm.
  // Lengths in mm. Each cell: the x and the vertical coordinate of its middle, the correction and its sigma.
  maps: {vertical: string; step: number; cells: [number, number, number, number][]; captures: [number, number][]}[];
}
