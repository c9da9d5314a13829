"""Event-capturing time stepping: steps of one length that solve for the signs, whatever events lie in them.

For x' = f(t, x) + sum_i b_i(t, x) s_i, s_i in Sgn(h_i), the theta scheme takes from x_k to x_{k+1}

    x_{k+1} = x_k + dt ((1 - theta) f_k + theta f_{k+1}) + dt sum_i ((1 - theta) b_i,k + theta b_i,k+1) s_i
    s_i in Sgn(h_i(t_{k+1}, x_{k+1}))

with one s_i a step, its mean over it: a state that reaches a surface that attracts lands on it and stays
there without chattering and without drift. A contact (an impact law that lets the state rest) has a push of
its surface in place of s_i and Newton's law at the level of dh/dt; it acts in the steps whose first half
closes it.

Sources: Moreau 1988; Jean 1999; Acary & Brogliato 2008, sections 9.4 and 10.1; Acary & Brogliato 2010
(implicit Euler for relays); Acary, Brogliato, Orlov 2012 (order two).
"""
