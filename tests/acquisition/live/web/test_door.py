"""Door of the live page: nobody comes in without the token, and no other page through it."""

from __future__ import annotations

from urllib.parse import urlsplit

import pytest

from tests.support.live.page_client import ask, with_token
from tests.support.live.pages import TOKEN

PATHS = ("/events", "/pictures/1.jpg", "/frames/0.jpg", "/", "/no/such/address")


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize(
    "query", ["", "?token=", "?token=wrong", f"?token={TOKEN}x", "?token=%CE%B8", "?Token=" + TOKEN]
)
def test_a_wrong_token_or_none_is_refused(page: str, path: str, query: str) -> None:
    answer = ask(page, path + query)
    assert (answer.status, answer.text.count("\n")) == (403, 1)
    assert "token" in answer.text


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1", "127.0.0.1:1", "[::1]", ""])
def test_a_foreign_host_is_refused(page: str, host: str) -> None:
    """A page that has its own name point to this computer sends its own name."""
    for path in (with_token(page, "/events"), "/static/page.js"):
        assert ask(page, path, headers={"Host": host}).status == 403


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "https://127.0.0.1", "http://127.0.0.1:1", ""]
)
def test_a_foreign_origin_is_refused(page: str, origin: str) -> None:
    """With the token even: another port of this computer is another origin."""
    assert ask(page, with_token(page, "/frames/0.jpg"), headers={"Origin": origin}).status == 403
    headers = {"Origin": origin, "X-Gonio-Token": TOKEN}
    assert ask(page, "/actions/abort", "POST", headers).status == 403


def test_both_names_of_this_computer_are_let_in(page: str) -> None:
    port = urlsplit(page).port
    for host in (f"127.0.0.1:{port}", f"localhost:{port}"):
        headers = {"Host": host, "Origin": f"http://{host}"}
        assert ask(page, with_token(page, "/frames/999.jpg"), headers=headers).status == 404


@pytest.mark.parametrize("method", ["GET", "HEAD", "PUT", "DELETE", "OPTIONS"])
def test_an_action_is_a_post_with_the_token_in_a_header(page: str, method: str) -> None:
    """No link and no form of another page can send a header."""
    assert ask(page, with_token(page, "/actions/abort"), "POST").status == 403
    assert ask(page, "/actions/abort", "POST", {"X-Gonio-Token": "wrong"}).status == 403
    headers = {"X-Gonio-Token": TOKEN}
    assert ask(page, with_token(page, "/actions/abort"), method, headers).status == 405


@pytest.mark.parametrize("path", ["/events?token=wrong", "/static/no.js", "/frames/999.jpg"])
def test_every_answer_carries_the_policy(page: str, path: str) -> None:
    headers = ask(page, path).headers
    assert "default-src 'none'" in headers["content-security-policy"]
    assert "unsafe" not in headers["content-security-policy"]
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["referrer-policy"] == "no-referrer"
    assert headers["cache-control"] == "no-store"
    assert "server" not in headers


@pytest.mark.parametrize("path", ["/static/../web/door.py", "/static/%2e%2e/channel.py",
                                  "/static//etc/passwd", "/static/%2Fetc%2Fpasswd"])  # fmt: skip
def test_static_files_are_those_of_the_page_alone(page: str, path: str) -> None:
    assert ask(page, path).status == 404
