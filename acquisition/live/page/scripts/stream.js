// The server's events. The browser reconnects by itself and says which event it had last; where it
// gives up (an answer that is no event stream), the stream is opened again after a while.

import { KINDS } from './scan.js';
import { address, isRefused } from './requests.js';

const AGAIN_MS = 2000;

// `take(kind, data)` gets each message; `connection` gets 'open', 'lost' or 'refused'.
export function follow(take, connection, again = false) {
  const source = new EventSource(address('/events'));
  for (const kind of KINDS) {
    source.addEventListener(kind, (event) => take(kind, parsed(event.data)));
  }
  source.onopen = () => {
    if (again) take('reset', null); // the server sends everything
    connection('open');
  };
  source.onerror = async () => {
    connection('lost');
    if (source.readyState !== EventSource.CLOSED) return;
    if (await isRefused()) connection('refused');
    else setTimeout(() => follow(take, connection, true), AGAIN_MS);
  };
}

const parsed = (data) => (data ? JSON.parse(data) : null);
