"""Skills for anysim: scripted solutions, a folder for each group of them."""
