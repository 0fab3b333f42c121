"""Still images of a world as it is drawn anew, again and again, with labels for detectors: no task is run."""
