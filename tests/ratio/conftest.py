"""Small batches and small estimators."""

from small_batches import batch, encoder, hands, local, rng, source

__all__ = ["batch", "encoder", "hands", "local", "rng", "source"]
