; reduction: theory §2.7. Scaling a force down never raises its drain, on every axis and for norms:
; (s F - fco)+ <= (F - fco)+ for 0 <= s <= 1, F the magnitude.
(set-logic QF_NRA)
(declare-const F Real)
(declare-const fco Real)
(declare-const s Real)
(declare-const x Real)
(declare-const y Real)
(assert (and (>= F 0) (>= fco 0) (>= s 0)))
(assert (<= s 1))  ; dropped in the twin
(assert (= x (ite (> F fco) (- F fco) 0)))
(assert (= y (ite (> (* s F) fco) (- (* s F) fco) 0)))
(assert (<= (* s F) F))  ; hint
(assert (or (> y x) (> (* y y) (* x x))))  ; negated conclusion
(check-sat)
