"""Signal temporal logic: formulas over signals and time, and their robustness.

`parse` turns text into a Formula. The robustness of a formula at a step is its distance to the opposite truth value
(Fainekos and Pappas 2009, Donze and Maler 2010). Windows are cut at the last step. An empty window has robustness +inf
for `always`, -inf for `eventually` and `until`.
"""
