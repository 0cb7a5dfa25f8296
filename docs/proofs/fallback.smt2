; fallback: theory §3. A force of at most fco is absorbed by Coulomb friction alone: it needs no
; credit. g: component of the force along the velocity, at most |F| (cauchy_schwarz).
(set-logic QF_NRA)
(declare-const fco Real)
(declare-const F Real)
(declare-const g Real)
(declare-const v Real)
(assert (and (>= F 0) (>= v 0) (<= g F)))
(assert (<= F fco))  ; dropped in the twin
(assert (>= (* v (- fco g)) 0))  ; hint
(assert (< (- (* fco v) (* g v)) 0))  ; negated conclusion
(check-sat)
