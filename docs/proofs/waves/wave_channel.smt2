; wave_channel: theory §5.2. A receiver that pays for what it passes on keeps its energy at or above 0, so
; that never more comes out of a channel than went in: over one period, U the sum that waits, x the
; share of it that is passed on, both lengths.
(set-logic QF_NRA)
(declare-const T Real)
(declare-const E Real)     ; arrived and not spent
(declare-const U Real)
(declare-const x Real)
(declare-const after Real)
(assert (and (> T 0) (>= E 0) (>= U 0) (>= x 0) (<= x U)))
(assert (<= (* x x) (* 2 T E)))  ; dropped in the twin
(assert (= (* 2 T after) (- (* 2 T E) (* x x))))
(assert (>= (* T after) 0))  ; hint
(assert (< after 0))  ; negated conclusion
(check-sat)
