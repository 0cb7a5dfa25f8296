; between_samples: theory §2.2. If T D(F) <= E', the loss after any part t of the interval is at most
; E' too, D(F) = (|F| - fco)^2 / (4 fd). Multiplied by 4 fd t.
(set-logic QF_NRA)
(declare-const fd Real)
(declare-const T Real)
(declare-const t Real)    ; time since the sample
(declare-const E Real)
(declare-const x Real)    ; (|F| - fco)+
(declare-const D Real)    ; drain, W
(declare-const d Real)    ; |displacement| against the force since the sample
(assert (and (> fd 0) (> T 0) (> t 0) (>= E 0) (>= x 0) (>= d 0)))
(assert (= (* 4 fd D) (* x x)))
(assert (<= (* T D) E))
(assert (<= t T))  ; dropped in the twin
(assert (>= D 0))  ; hint
(assert (<= (* t D) E))  ; hint
(assert (>= (* (- (* 2 fd d) (* x t)) (- (* 2 fd d) (* x t))) 0))  ; hint
(assert (= (* x x t t) (* 4 fd D t t)))  ; hint
(assert (<= (* 4 fd D t t) (* 4 fd E t)))  ; hint
(assert (< (* 4 fd (+ (* E t) (* fd d d) (* (- x) d t))) 0))  ; negated conclusion
(check-sat)
