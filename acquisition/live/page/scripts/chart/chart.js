// Chart of the curves: uPlot gives axes, grid and size, `drawing.js` the rest. A click selects.

import { number } from '../format.js';
import { colour } from '../theme.js';
import { nearest, xRange, yRange } from './curves.js';
import { drawCurves, frameOf } from './drawing.js';

const { uPlot } = window;
const REACH_PX = 30; // of a click
const FONT = '13px system-ui, "Segoe UI", Arial, "DejaVu Sans", sans-serif';
const X_LABELS = {
  theta_r: 'Viewing angle θᵣ (°)',
  theta_i: 'Angle of incidence θᵢ (°)',
  dphi: 'Azimuth between lamp and camera Δφ (°)',
};

export class Chart {
  constructor(parent, select) {
    Object.assign(this, {
      parent,
      select,
      curves: [],
      selected: null,
      labels: '',
      plot: null,
      drawn: null,
    });
    new ResizeObserver(() => this.plot?.setSize(this.size())).observe(parent);
  }

  // Nothing is drawn again for messages that change nothing here, such as a moving axis.
  show(scan, curves, selected) {
    const theme = document.documentElement.dataset.theme;
    const key = [scan.drawing, theme, selected?.step, ...curves.map((curve) => curve.name)].join();
    if (key === this.drawn) return;
    this.drawn = key;
    Object.assign(this, { curves, selected, x: xRange(scan, curves), y: yRange(curves) });
    this.label(X_LABELS[scan.run?.sweep] ?? 'Angle (°)', valueLabel(scan.run));
    this.plot.setData([this.x, this.y]); // only for the axes
  }

  // uPlot's labels are fixed: another label is another plot.
  label(...labels) {
    if (this.plot && this.labels === labels.join()) return;
    this.labels = labels.join();
    this.plot?.destroy();
    this.plot = new uPlot(
      this.options(...labels),
      [
        [0, 1],
        [0, 1],
      ],
      this.parent,
    );
    this.plot.over.addEventListener('click', (event) => this.click(event));
  }

  size() {
    return { width: this.parent.clientWidth, height: this.parent.clientHeight };
  }

  options(xLabel, yLabel) {
    return {
      ...this.size(),
      scales: { x: { time: false, range: () => this.x }, y: { range: () => this.y } },
      series: [{}, { show: true, paths: () => null, points: { show: false } }],
      axes: [axis(xLabel, 34, '°'), axis(yLabel, widthOf, '')],
      legend: { show: false },
      cursor: { show: false },
      hooks: { draw: [(plot) => drawCurves(frameOf(plot), this.curves, this.selected)] },
    };
  }

  click({ offsetX, offsetY }) {
    const frame = frameOf(this.plot);
    const distance = (point) => {
      const [x, y] = frame.placed(point);
      return Math.hypot(
        (x - frame.left) / frame.scale - offsetX,
        (y - frame.top) / frame.scale - offsetY,
      );
    };
    const points = this.curves.flatMap((curve) => curve.points);
    const found = points.length ? nearest(points, distance) : null;
    this.select(found && distance(found) <= REACH_PX ? found.step : null);
  }
}

function valueLabel(run) {
  if (!run) return '';
  return `${run.quantity === 'BRDF' ? 'BRDF fᵣ' : 'Radiance'} (${run.unit})`;
}

function axis(label, size, unit) {
  return {
    label,
    size,
    font: FONT,
    labelFont: `bold ${FONT}`,
    labelSize: 26,
    stroke: () => colour('--ink'),
    grid: { stroke: () => colour('--rule'), width: 1 },
    ticks: { stroke: () => colour('--soft'), width: 1 },
    values: (plot, splits, index, space, step) => splits.map((v) => tick(v, step) + unit),
  };
}

// Width of the numbers beside the axis, in CSS pixels.
const widthOf = (plot, words) => 16 + 8 * Math.max(3, ...(words ?? []).map((word) => word.length));

// All numbers of an axis with the decimals that its step needs.
function tick(value, step) {
  const decimals = [0, 1, 2, 3, 4].find((n) => isWhole(step * 10 ** n));
  if (decimals === undefined || step > 1e4) return number(value);
  return value.toFixed(decimals).replace('-', '\u2212');
}

const isWhole = (x) => Math.abs(x - Math.round(x)) < 1e-6 * x;
