// The last events of the record, newest first.

import { by, fill, make } from '../dom.js';
import { timeOfDay } from '../format.js';

const MOST = 50;

export function showEvents(scan) {
  const newest = [...scan.events.values()].sort((a, b) => b.number - a.number).slice(0, MOST);
  fill(by('events-list'), newest, (events) =>
    events.length ? events.map(row) : [make('li', {}, 'None yet.')],
  );
}

function row({ time_utc: utc, kind, text }) {
  const time = make('time', { dateTime: utc }, timeOfDay(utc));
  return make('li', {}, time, make('span', {}, make('b', {}, kind), ` ${text}`));
}
