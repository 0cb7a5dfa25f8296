; residual_lease: theory §2.5. A lease covered when it was granted stays covered: after the force has
; acted for t of its lease L, E is at least what the rest of it can lose, and never below 0. So an
; answer that never begins, or one of at most fco, needs nothing new.
(set-logic QF_NRA)
(declare-const G Real)   ; E when granted
(declare-const E Real)   ; E now
(declare-const L Real)
(declare-const t Real)
(declare-const D Real)
(assert (and (>= D 0) (>= L 0)))
(assert (>= G (* L D)))
(assert (>= E (- G (* t D))))
(assert (and (<= 0 t) (<= t L)))  ; dropped in the twin
(assert (>= (* (- L t) D) 0))  ; hint
(assert (or (< E (* (- L t) D)) (< E 0)))  ; negated conclusion
(check-sat)
