"""Compilation of kernels where numba has no place for its cache."""

from typing import Any

import numba
import pytest

from anysim.math.compiled import compiled


def test_kernels_compile_where_no_cache_can_be_written(monkeypatch: pytest.MonkeyPatch) -> None:
    real = numba.njit

    def without_a_place(cache: bool = False, **options: Any) -> Any:
        if cache:
            raise RuntimeError("cannot cache function 'f': no locator available for file 'f.py'")
        return real(**options)

    with monkeypatch.context() as numba_alone:  # which compiles some things of its own when it compiles the first
        numba_alone.setattr(numba, "njit", without_a_place)
        kernel = compiled(lambda x: x + 1)
    assert kernel(1) == 2


def test_other_compilation_faults_are_not_hidden(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(**options: Any) -> Any:
        raise RuntimeError("out of order")

    monkeypatch.setattr(numba, "njit", broken)
    with pytest.raises(RuntimeError, match="out of order"):
        compiled(lambda x: x)
