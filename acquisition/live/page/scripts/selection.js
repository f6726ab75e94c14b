// The selected point: one step of the plan, or none.

export class Selection {
  constructor(changed) {
    this.step = null;
    this.changed = changed;
  }

  select(step) {
    if (step === this.step) return;
    this.step = step;
    this.changed();
  }

  pointIn(scan) {
    return this.step === null ? null : (scan.points.get(this.step) ?? null);
  }
}
