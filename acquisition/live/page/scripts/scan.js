// All that is known of the scan: the newest message of each key. Panels read it, the stream writes.

export const KINDS = [
  'reset',
  'run',
  'point',
  'model',
  'progress',
  'rig',
  'picture',
  'happened',
  'aim',
];

const DRAWN = ['reset', 'run', 'point', 'model'];

export class Scan {
  constructor() {
    this.drawing = 0; // grows with everything that the chart shows
    this.clear();
  }

  clear() {
    Object.assign(this, {
      run: null,
      model: null,
      progress: null,
      rig: null,
      picture: null,
      aim: null,
    });
    this.points = new Map(); // by step of the plan
    this.events = new Map(); // by number
    this.sharpness = []; // the last values while aiming
  }

  take(kind, data) {
    if (kind === 'reset') this.clear();
    else if (kind === 'point') this.points.set(data.step, data);
    else if (kind === 'happened') this.events.set(data.number, data);
    else this[kind] = data;
    if (DRAWN.includes(kind)) this.drawing += 1;
    if (kind === 'aim') this.sharpness = [...this.sharpness, data.sharpness].slice(-200);
  }

  get aiming() {
    return Boolean(this.run?.aiming);
  }

  get inOrder() {
    return [...this.points.values()].sort((a, b) => a.step - b.step);
  }

  get flagged() {
    return this.inOrder.filter((point) => point.flags.length > 0);
  }

  allows(action) {
    return Boolean(this.progress?.actions.includes(action));
  }
}
