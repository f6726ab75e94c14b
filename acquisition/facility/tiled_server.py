"""Runs on a Tiled server: the documents go there, and the table comes back."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit, urlunsplit

from acquisition.facility.documents import run_documents
from acquisition.facility.metadata import TABLE
from acquisition.facility.table_columns import table_of
from instrument.errors import InputError, StorageError

_OWN = ("seq_num", "time")  # columns of the server beside those of the events
_TIMES = "ts_"


def send_run(folder: Path, url: str) -> str:
    """Write the documents of a run to a Tiled server; return the run's identifier there.

    url: address of the server's API with a key, as `tiled serve` prints it; the key may stand in
    TILED_API_KEY instead. Raises `InputError` where the run is there already, and `StorageError`
    where the server does not answer or refuses.
    """
    documents = list(run_documents(folder))
    uid = str(documents[0][1]["uid"])
    with _client(url) as (client, writer):
        if uid in client:
            raise InputError(f"{_bare(url)}: holds the run {folder} already, as {uid}")
        for name, document in documents:
            writer(name, document)
    return uid


def fetch_table(url: str, uid: str) -> str:
    """Return the text of measurements.csv of a run on a Tiled server.

    url: as for `send_run`. uid: the run's identifier there. Raises `InputError` for a run that is
    not there or is none of gonio, and `StorageError` where the server does not answer.
    """
    with _client(url) as (client, _):
        if uid not in client:
            raise InputError(f"{_bare(url)}: holds no run {uid}")
        run = client[uid]
        if TABLE not in run:
            raise InputError(f"{_bare(url)}: the run {uid} has no stream {TABLE!r}: is it gonio's?")
        frame = run[TABLE].base["internal"].read()
    frame = frame.sort_values("seq_num")
    names = [n for n in frame.columns if n not in _OWN and not n.startswith(_TIMES)]
    return table_of({name: frame[name].tolist() for name in names})


@contextmanager
def _client(url: str) -> Iterator[tuple[Any, Any]]:
    """Connect to a server; yield its client and the writer of documents."""
    try:
        import httpx
        from bluesky.callbacks.tiled_writer import TiledWriter
        from tiled.client import from_context
        from tiled.client.context import Context
    except ImportError:
        raise InputError(
            "a Tiled server: its client is not installed: pip install 'gonio[tiled]'"
        ) from None
    try:
        context, node = Context.from_any_uri(url)
        with closing(context):
            client = from_context(context, node_path_parts=node)
            yield client, TiledWriter(client)
    except (httpx.HTTPError, httpx.InvalidURL, ValueError) as error:
        raise StorageError(
            f"{_bare(url)}: {error}: is it the address of a Tiled server, and does its key (at the "
            "end of the address, or in TILED_API_KEY) allow to write?"
        ) from error


def _bare(url: str) -> str:
    """Return an address without its key."""
    parts = urlsplit(url)
    return urlunsplit((parts.scheme, parts.netloc.rpartition("@")[2], parts.path, "", ""))
