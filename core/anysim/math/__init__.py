"""Batched pose mathematics. Elementwise only, so that row i of a batch never depends on the batch's size."""
