"""The skip policy of conftest.py: in strict mode only the listed reasons may skip a test."""

from __future__ import annotations

from pathlib import Path

import pytest

SKIPS = """
    import pytest

    def test_without_reason(): pytest.skip("did not feel like it")
    def test_without_recording(data_file): data_file("no-such-recording.gpx")
    def test_passes(): pass
    @pytest.mark.skip(reason="later")
    def test_marked(): pass
    @pytest.mark.xfail(reason="known")
    def test_known(): assert False
"""


@pytest.fixture
def policy(pytester: pytest.Pytester) -> pytest.Pytester:
    conftest = Path(__file__).with_name("conftest.py").read_text()
    pytester.makeconftest(conftest.replace('pytest_plugins = ["pytester"]', ""))
    return pytester


def test_a_developer_may_skip(policy: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("TRACKFIELD_STRICT_SKIPS", raising=False)
    policy.makepyfile(SKIPS)
    policy.runpytest_inprocess().assert_outcomes(passed=1, skipped=3, xfailed=1)


def test_the_ci_refuses_unexpected_skips(policy: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TRACKFIELD_STRICT_SKIPS", "1")
    policy.makepyfile(SKIPS)
    result = policy.runpytest_inprocess()
    assert result.ret == 1
    result.stdout.fnmatch_lines_random(["*unexpected skip: did not feel like it*", "*unexpected skip: later*"])
    # A skip by mark happens at set-up, which pytest counts as an error.
    result.assert_outcomes(failed=1, errors=1, passed=1, skipped=1, xfailed=1)


def test_a_module_that_skips_itself_is_refused_too(policy: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TRACKFIELD_STRICT_SKIPS", "1")
    policy.makepyfile("import pytest\npytest.importorskip('no_such_module')")
    result = policy.runpytest_inprocess()
    assert result.ret != 0
    result.stdout.fnmatch_lines(["*unexpected skip: could not import 'no_such_module'*"])
