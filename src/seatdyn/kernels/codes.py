"""Numbers by which the compiled laws are called: one per law, shared by model and kernels."""

QUADRATIC = 1
COULOMB = 2
JUMP = 3
GAP = 4
END_STOP = 5
TANGENT_POLYNOMIAL = 6
POLYNOMIAL_DAMPER = 7
ASYMMETRIC_DAMPER = 8
TABLE_SPRING = 9
TABLE_DAMPER = 10
CONSTANT = 11
USER = 12
