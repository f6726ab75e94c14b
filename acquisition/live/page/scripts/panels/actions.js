// Pause, resume and abort: those that the scan offers now. Abort asks once.

import { by, show, write } from '../dom.js';
import { count } from '../format.js';
import { act } from '../requests.js';

const ACTIONS = ['pause', 'resume', 'abort'];

export class Actions {
  constructor(scan) {
    Object.assign(this, { scan, connected: false, asked: null });
    for (const action of ['pause', 'resume'])
      by(action).addEventListener('click', () => this.ask(action));
    by('abort').addEventListener('click', () => this.askOnce());
    by('abort-no').addEventListener('click', () => by('abort-dialog').close());
    by('abort-yes').addEventListener('click', () => {
      by('abort-dialog').close();
      this.ask('abort');
    });
  }

  show() {
    if (this.asked?.state !== this.scan.progress?.state) this.asked = null; // the scan has answered
    for (const action of ACTIONS) {
      show(action, this.scan.allows(action));
      by(action).disabled = !this.connected || this.asked !== null;
    }
    show(
      'buttons',
      ACTIONS.some((action) => this.scan.allows(action)),
    );
    if (!this.scan.allows('abort')) by('abort-dialog').close();
    write('abort-text', consequences(this.scan));
    write('asked', this.asked ? `Asked the scan to ${this.asked.action}.` : '');
  }

  pauseOrResume() {
    for (const action of ['pause', 'resume']) {
      if (this.scan.allows(action) && !by(action).disabled) return this.ask(action);
    }
    return null;
  }

  askOnce() {
    write('abort-text', consequences(this.scan));
    by('abort-dialog').showModal();
  }

  // Buttons rest until the scan's state has changed, or the request was refused.
  async ask(action) {
    this.asked = { action, state: this.scan.progress.state };
    this.show();
    const refusal = await act(action);
    if (refusal) this.asked = null;
    write('answer', refusal);
    show('answer', refusal !== '');
    this.show();
  }
}

function consequences(scan) {
  const folder = scan.run?.folder ? ` ${scan.run.folder}` : '';
  return (
    'The stage stops, and the lamp is darkened as far as the rig can. ' +
    `${count(scan.points.size, 'reading')} ${scan.points.size === 1 ? 'is' : 'are'} kept; ` +
    `gonio resume${folder} goes on from there.`
  );
}
