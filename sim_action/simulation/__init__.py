"""The simulation of one scenario: loop, controllers, sensors, monitors, watchdog and start checks."""
