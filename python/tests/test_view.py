"""The viewer, started from Python."""

import os
import urllib.error
import urllib.request
import webbrowser

import pytest
import voxdag

PROGRAM = os.environ.get("VOXDAG_PROGRAM", "")
needs_program = pytest.mark.skipif(not PROGRAM, reason="the program voxdag is not built")


@needs_program
def test_the_viewer_runs_until_it_is_closed(dag, monkeypatch):
    opened = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    with dag.view(program=PROGRAM) as viewer:
        assert opened == [viewer.url] and viewer.url in repr(viewer)
        with urllib.request.urlopen(viewer.url) as page:
            assert b"<title>" in page.read()
        shown = viewer._repr_html_()
        assert f"href='{viewer.url}'" in shown and "data:image/png" in shown
    with pytest.raises(urllib.error.URLError):
        urllib.request.urlopen(viewer.url)
    viewer.close()


@needs_program
def test_no_browser_opens_on_request(dag, monkeypatch):
    monkeypatch.setattr(webbrowser, "open", lambda url: pytest.fail("a browser opens"))
    dag.view(open_browser=False, program=PROGRAM).close()


@needs_program
def test_a_viewer_that_cannot_start_says_why(path, tmp_path):
    copy = tmp_path / "gone.vdag"
    copy.write_bytes(path.read_bytes())
    with voxdag.open(copy) as dag:
        copy.unlink()
        with pytest.raises(voxdag.Error, match=r"gone\.vdag"):
            dag.view(open_browser=False, program=PROGRAM)


def test_a_missing_program_is_named(dag, tmp_path):
    with pytest.raises(FileNotFoundError, match=r"no program '.*/nothing'"):
        dag.view(program=str(tmp_path / "nothing"))
