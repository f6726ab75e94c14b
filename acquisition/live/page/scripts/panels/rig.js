// The rig: position of each axis, and the lamp.

import { by, fill, make, show } from '../dom.js';
import { degrees } from '../format.js';

const LAMP = { lit: '● lit', darkened: '○ darkened', unknown: '? not known' };

export function showRig({ rig }) {
  const known = Boolean(rig) && (rig.axes.length > 0 || rig.lamp !== 'unknown');
  show('rig', known);
  if (!known) return;
  const rows = rig.axes.map((axis) => [axis.label, degrees(axis.deg), stateOf(axis)]);
  fill(by('axes'), [...rows, ['Lamp', LAMP[rig.lamp] ?? rig.lamp, '']], (all) => all.map(row));
}

function stateOf({ moving, by_hand: byHand }) {
  if (moving) return byHand ? 'is being set by hand' : 'moving';
  return byHand ? 'set by hand' : '';
}

function row([name, value, state]) {
  const cells = [
    make('td', { className: 'number' }, value),
    make('td', { className: 'soft' }, state),
  ];
  return make('tr', {}, make('th', { scope: 'row' }, name), ...cells);
}
