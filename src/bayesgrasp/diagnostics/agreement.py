r"""Agreement of two raters beyond chance: Cohen's kappa with its interval.

With p_ij the share of cases that the first rater puts into category i and the second into j, p_o = sum_i p_ii and
p_e = sum_i p_i. p_.i,

    kappa = (p_o - p_e) / (1 - p_e),

1 for perfect agreement and 0 for what independent raters with the same shares would reach (Cohen 1960). The interval
is kappa +- z s with the large-sample variance of Fleiss, Cohen and Everitt (1969),

    n (1 - p_e)^2 s^2 = sum_i p_ii (1 - (p_i. + p_.i)(1 - kappa))^2
                        + (1 - kappa)^2 sum_{i != j} p_ij (p_.i + p_j.)^2 - (kappa - p_e (1 - kappa))^2.
"""

import numpy as np
from jaxtyping import Int64
from scipy.stats import norm

from bayesgrasp.errors import InvalidConfigurationError

Table = Int64[np.ndarray, "categories categories"]


def confusion(first: np.ndarray, second: np.ndarray, categories: int) -> Table:
    """Counts by category of the first rater (rows) and of the second (columns).

    Args:
        first: Category of each case, from 0.
        second: Likewise.
        categories: How many there are.

    Raises:
        InvalidConfigurationError: Not as many cases, or a category out of range.
    """
    if first.shape != second.shape:
        raise InvalidConfigurationError(f"two raters must see the same cases, got {first.shape} and {second.shape}")
    table = np.zeros((categories, categories), dtype=np.int64)
    if first.size and max(int(first.max()), int(second.max())) >= categories:
        raise InvalidConfigurationError(f"categories must be below {categories}")
    np.add.at(table, (first.astype(np.int64), second.astype(np.int64)), 1)
    return table


def cohens_kappa(table: Table, level: float = 0.95) -> tuple[float, tuple[float, float]]:
    """Kappa of a confusion table, and its interval.

    Raises:
        InvalidConfigurationError: No case, or all in one category, where kappa is not defined.
    """
    total = int(table.sum())
    share = table / max(total, 1)
    rows, columns = share.sum(axis=1), share.sum(axis=0)
    chance = float(rows @ columns)
    if total == 0 or chance >= 1.0:
        raise InvalidConfigurationError("kappa needs cases in at least two categories")
    kappa = (float(np.trace(share)) - chance) / (1.0 - chance)
    # The three sums of the variance, in the order of the formula above; rows and columns are p_i. and p_.i.
    agreeing = float(np.diag(share) @ (1.0 - (rows + columns) * (1.0 - kappa)) ** 2)
    # (i, j) is weighed by p_.i + p_j., the shares of the *other* rater: columns along i, rows along j.
    apart = (1.0 - np.eye(len(table))) * share * (columns[:, None] + rows[None, :]) ** 2
    spread = agreeing + (1.0 - kappa) ** 2 * float(apart.sum()) - (kappa - chance * (1.0 - kappa)) ** 2
    half = float(norm.ppf(0.5 + level / 2)) * float(np.sqrt(max(spread, 0.0) / total)) / (1.0 - chance)
    return kappa, (max(kappa - half, -1.0), min(kappa + half, 1.0))
