"""The parts of `report.html` that are there without a script: what each scenario came to, in words and a drawing."""
