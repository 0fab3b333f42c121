"""Comparison of engines: layers, probes with known answers, and the page that shows them."""
