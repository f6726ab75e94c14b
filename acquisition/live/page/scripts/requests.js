// Addresses at the page's own server. The token is part of the address that the program printed.

const token = new URLSearchParams(location.search).get('token') ?? '';

export const address = (path) => `${path}?token=${encodeURIComponent(token)}`;
export const pictureAddress = (number) => address(`/pictures/${number}.jpg`);
export const frameAddress = (step) => address(`/frames/${step}.jpg`);

// Ask the scan to pause, resume or abort. The answer: '' if it will, or the reason why not.
export async function act(action) {
  let response;
  try {
    response = await fetch(`/actions/${action}`, {
      method: 'POST',
      headers: { 'X-Gonio-Token': token },
    });
  } catch {
    return 'The page’s server does not answer. Use the terminal of the scan.';
  }
  if (response.ok) return '';
  if (response.status === 403) return 'Refused: open the address that the program printed last.';
  return (await response.text()) || `Refused (HTTP ${response.status}).`;
}

// Whether the server refuses this address, that is, its token is of an earlier start.
export async function isRefused() {
  try {
    return (await fetch(address('/'))).status === 403;
  } catch {
    return false;
  }
}
