// Keys: P pauses or resumes; left and right go along the points, with the focus on the chart also up
// and down to other curves; Escape selects none.

import { by } from './dom.js';
import { neighbour } from './chart/curves.js';

const ALONG = { ArrowLeft: -1, ArrowRight: 1 };
const ACROSS = { ArrowUp: -1, ArrowDown: 1 };

export function listen(curves, selection, pauseOrResume) {
  document.addEventListener('keydown', (event) => {
    if (isTyped(event)) return;
    const onChart = document.activeElement === by('chart');
    if (event.key === 'p' && !event.repeat) pauseOrResume();
    else if (event.key === 'Escape') selection.select(null);
    else if (event.key in ALONG || (onChart && event.key in ACROSS)) {
      const [along, across] = [ALONG[event.key] ?? 0, ACROSS[event.key] ?? 0];
      selection.select(neighbour(curves(), selection.step, along, across));
      event.preventDefault();
    }
  });
}

function isTyped(event) {
  if (event.ctrlKey || event.altKey || event.metaKey || by('abort-dialog').open) return true;
  return event.target instanceof HTMLSelectElement;
}
