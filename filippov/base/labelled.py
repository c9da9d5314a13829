"""Values that carry their names, as rows and tables of pandas do: read by name, never by place."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from filippov.base.errors import UsageError
from filippov.base.names import unknown


def by_label(value: Any) -> dict[str, Any] | None:
    """A Series (with text as its index), a DataFrame or an array of records as a dict; None for all else.

    pandas is not loaded for it.
    """
    if hasattr(value, "columns") and hasattr(value, "to_numpy"):
        labels, columns = list(value.columns), value.to_numpy().T
    elif hasattr(value, "index") and hasattr(value, "to_numpy") and getattr(value, "ndim", 0) == 1:
        labels, columns = list(value.index), value.to_numpy()
    elif getattr(getattr(value, "dtype", None), "names", None):
        labels = list(value.dtype.names)
        columns = [value[name] for name in labels]
    else:
        return None
    if not labels or not all(isinstance(label, str) for label in labels):
        return None
    return dict(zip(labels, columns, strict=True))


def in_order(value: Any, names: Sequence[str], what: str) -> list[Any] | None:
    """What `by_label` finds in the order of names; None where nothing has labels.

    A named tuple counts where its fields are these names. Raises UsageError for other labels.
    """
    labelled: Mapping[str, Any] | None = by_label(value)
    fields = getattr(value, "_fields", ())
    if labelled is None and isinstance(value, tuple) and set(fields) == set(names):
        labelled = dict(zip(fields, value, strict=True))
    if labelled is None:
        return None
    for name in labelled:
        if name not in names:
            raise UsageError(
                f"{what} is read by its labels: {unknown('state', name, names)}. Choose the columns of the "
                f"states, given[{list(names)!r}], or give the numbers alone, given.to_numpy()."
            )
    missing = [name for name in names if name not in labelled]
    if missing:
        raise UsageError(
            f"{what} is read by its labels ({', '.join(labelled)}) and has no {', '.join(missing)}; expected "
            f"one for each of {', '.join(names)}."
        )
    return [labelled[name] for name in names]
