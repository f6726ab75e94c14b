// States, flags and places in words.

import { count, degrees, number, percent } from './format.js';

// Name; colour class: good, wait (somebody has to do something or wait), bad; words where the scan
// has none of its own.
export const STATES = {
  measuring: ['Measuring', 'good'],
  pausing: ['Pausing', 'wait'],
  paused: ['Paused', 'wait', 'Nothing moves until it is resumed.'],
  operator: ['Waiting for the operator', 'wait'],
  ending: ['Ending', 'wait'],
  finished: ['Finished', 'good'],
  stopped: ['Stopped', 'wait'],
  failed: ['Ended by a fault', 'bad'],
  lost: ['The scan no longer answers', 'bad'],
  aiming: ['Aiming', 'good', 'Turn the lens; Ctrl-C in the terminal ends it.'],
};

export const ENDED = ['finished', 'stopped', 'failed', 'lost'];

// Each flag of a reading: what was seen, and what it means or what to do. Others are shown as they are.
const FLAGS = {
  saturated: [
    saturated,
    'The true value is higher; lower exposure_target, close the aperture or dim the lamp.',
  ],
  'window leaves frame': ['the measured window leaves the picture', 'Look at the camera’s aim.'],
  'too few pixels': [
    (p) => `the window covers only ${number(p.window_pixels, 3)} pixels`,
    'View it less obliquely, or choose a larger window.',
  ],
  'hot pixels': [
    'hot pixels cover too much of the window',
    'Cool the camera or use a shorter exposure.',
  ],
  'dead pixels': ['dead pixels cover too much of the window', 'Move the window in the picture.'],
  'no signal': ['no light was measured', 'Look at the lamp and its shutter.'],
  'dark patch leaves frame': [
    'the dark patch, which measures stray light, leaves the picture',
    'Look at the camera’s aim.',
  ],
  'dark patch is bright': [
    'the dark patch, which measures stray light, is lit',
    'Look at what shines on it.',
  ],
  'frames differ': [
    'its frames differ by more than their noise',
    'Look for flicker of the lamp or motion.',
  ],
  'not at its place in the next picture': [
    'the next picture shows the sample elsewhere',
    'Look at the stage; a resume measures it again.',
  ],
  'lamp failed at the next reference': [
    'the lamp failed before the next reference',
    'Look at the lamp; a resume measures it again.',
  ],
  interlock: ['an interlock ended the scan here', 'The last events say why.'],
};
const OF_TILE = [
  'the white tile that its BRDF needs is flagged',
  'Look at the tile’s own reading.',
];

function saturated(point) {
  const part = `${number(point.peak_dn)} of ${point.full_scale_dn} DN`;
  if (point.saturated_pixels > 0) {
    return `${count(point.saturated_pixels, 'pixel')} of ${count(point.frames, 'frame')} at full scale (brightest part ${part})`;
  }
  const share = percent(point.peak_dn / point.full_scale_dn);
  return `its brightest part has ${part} (${share}), too near full scale to be trusted`;
}

const meaningOf = (flag) => FLAGS[flag] ?? (flag.startsWith('white tile ') ? OF_TILE : []);

export function flagInWords(flag, point) {
  const [seen] = meaningOf(flag);
  if (!seen) return flag;
  return `${flag}: ${typeof seen === 'function' ? seen(point) : seen}`;
}

export function adviceOn(flag) {
  const [, advice] = meaningOf(flag);
  return advice ?? '';
}

const SURFACES = { tile: 'White tile', drift: 'Drift check' };

export function place(point) {
  const angles = `θᵢ ${degrees(point.theta_i_deg)}, θᵣ ${degrees(point.theta_r_deg)}`;
  const azimuth = point.dphi_deg ? `, Δφ ${degrees(point.dphi_deg)}` : '';
  const surface = SURFACES[point.kind];
  return (surface ? `${surface}, ` : '') + angles + azimuth;
}
