// State of the scan, how far it is, and the connection to the page's server.

import { by, show, write } from '../dom.js';
import { clockIn, count, duration, percent, timeOfDay } from '../format.js';
import { ENDED, STATES } from '../words.js';

export function showState(scan) {
  const { progress } = scan;
  if (!progress) return;
  const [name, looks, words = ''] = STATES[progress.state] ?? [progress.state, 'wait'];
  write('state-name', name);
  by('state-name').className = `pill ${looks}`;
  const own = progress.text && progress.text !== progress.state;
  const text = own ? capitalised(progress.text) : words;
  write('state-text', text);
  announce(progress.state, `${name}. ${text}`);
  showTitle(scan, name);
  showProgress(progress);
}

// Symbols such as θ stay what they are.
const capitalised = (text) => text.replace(/^[a-z]/, (letter) => letter.toUpperCase());

// Read aloud when the state changes, not at every point.
let announced = null;
function announce(state, words) {
  if (state === announced) return;
  announced = state;
  write('state-spoken', words);
}

function showTitle({ run, progress, aiming }, name) {
  const title = run?.title ?? 'gonio';
  write('title', title);
  write('sample', run ? subtitle(run) : '');
  const share = progress.total && !aiming ? `${percent(progress.done / progress.total)} · ` : '';
  document.title = `${share}${name} · ${title}`;
}

function subtitle(run) {
  const started = run.started_utc ? `started ${timeOfDay(run.started_utc)}` : '';
  return [run.sample, run.rig && `rig ${run.rig}`, run.folder, started].filter(Boolean).join(' · ');
}

function showProgress({ state, done, total, elapsed_s, left_s }) {
  const share = total ? done / total : 0;
  by('bar').value = share;
  const spent = Number.isFinite(elapsed_s ?? NaN) ? `, ${duration(elapsed_s)} spent` : '';
  write('done', total ? `${percent(share)} · ${done} of ${count(total, 'reading')}${spent}` : '');
  write('left', timeLeft(state, left_s));
}

function timeLeft(state, seconds) {
  if (ENDED.includes(state) || seconds === null || seconds === undefined) return '';
  if (state !== 'measuring') return `· ${duration(seconds)} left once it goes on`;
  return `· about ${duration(seconds)} left, until ${clockIn(seconds)}`;
}

const CONNECTION = {
  open: '',
  lost: 'Connection lost, trying again. What is shown may be old; the scan itself does not need this page.',
  refused: 'The server refuses this address. Open the address that the program printed last.',
};

export function showConnection(connection, scan) {
  const over = connection === 'lost' && ENDED.includes(scan.progress?.state);
  const words = over
    ? `The page has ended, as the scan has; gonio watch ${scan.run?.folder ?? ''} shows the run again.`
    : CONNECTION[connection];
  write('connection', words);
  show('connection', words !== '');
  by('connection').classList.toggle('calm', over);
  document.body.classList.toggle('stale', connection !== 'open' && !over);
}
