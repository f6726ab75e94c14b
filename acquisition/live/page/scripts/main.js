// The live page: messages of the server go into the scan, panels show it. Start reading here.

import { Chart } from './chart/chart.js';
import { curvesOf } from './chart/curves.js';
import { Legend } from './chart/legend.js';
import { by } from './dom.js';
import { listen } from './keyboard.js';
import { Actions } from './panels/actions.js';
import { showAim } from './panels/aim.js';
import { showAttention } from './panels/attention.js';
import { showEvents } from './panels/events.js';
import { showKeptFrames } from './panels/kept_frames.js';
import { showLevels } from './panels/levels.js';
import { Picture } from './panels/picture.js';
import { showRig } from './panels/rig.js';
import { showSelected } from './panels/selected.js';
import { showConnection, showState } from './panels/state.js';
import { Scan } from './scan.js';
import { Selection } from './selection.js';
import { follow } from './stream.js';
import { useTheme } from './theme.js';

const TOGETHER_MS = 50; // messages that arrive within this time are shown at once
const EVERY_MS = 500; // between two drawings in a scan, which needs the computer; AIMING_MS: of a lens
const AIMING_MS = 150;

const scan = new Scan();
const selection = new Selection(showAll);
const actions = new Actions(scan);
const picture = new Picture();
const legend = new Legend(showAll);
const curves = () => legend.visible(curvesOf(scan));
const chart = new Chart(by('chart'), (step) => selection.select(step));
let waiting = null;
let shownAt = -Infinity;

function showSoon() {
  const due = shownAt + (scan.aiming ? AIMING_MS : EVERY_MS) - performance.now();
  waiting ??= setTimeout(() => {
    waiting = null;
    shownAt = performance.now();
    showAll();
  }, Math.max(TOGETHER_MS, due));
}

function showAll() {
  document.body.classList.toggle('aiming', scan.aiming);
  const point = selection.pointIn(scan);
  showState(scan);
  actions.show();
  showAttention(scan, selection);
  showSelected(scan, point);
  picture.show(scan);
  showKeptFrames(scan, selection);
  showLevels(scan);
  showAim(scan);
  showRig(scan);
  showEvents(scan);
  legend.show(scan);
  if (!scan.aiming) chart.show(scan, curves(), point);
}

function connection(state) {
  actions.connected = state === 'open';
  showConnection(state, scan);
  showSoon();
}

by('unselect').addEventListener('click', () => selection.select(null));
listen(curves, selection, () => actions.pauseOrResume());
useTheme(showAll);
follow((kind, data) => {
  scan.take(kind, data);
  if (kind === 'picture') picture.show(scan); // before the next one supersedes it
  showSoon();
}, connection);
