"""Signal temporal logic: what is said of signals over time, and by how much it holds.

Text -> `parse` -> Formula; a formula over samples of signals -> its robustness at every moment, which is the distance
to the other truth value (Fainekos and Pappas 2009, Donze and Maler 2010). Moments are physics steps; a window that
reaches beyond the last of them is cut there: nothing in it is +inf for `always`, -inf for `eventually` and `until`.
"""
