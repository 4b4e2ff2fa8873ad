"""One run: the loop, controllers, sensors, monitors, watchdog and the checks before the start."""
