"""The results database: what came out of every body, and who let what pass.

The recordings hold the truth; of bodies, features and axes these tables are an index that
`cell results rebuild` makes again. Visits, faults, bypasses and approvals are records of their own.
"""
