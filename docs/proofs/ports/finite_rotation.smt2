; finite_rotation: theory §2.8. Let a body turn along a way of angle p, x be the length of R − 1 and m
; what the axial part of R − R' over 2 misses of the integral of the angular velocity. One more step
; of angle s about one axis adds at most s x + s s / 2 to m: so m stays within p p / 2. x is at most
; p, a chord being no longer than its arc.
(set-logic QF_NRA)
(declare-const p Real)
(declare-const s Real)
(declare-const x Real)
(declare-const m Real)
(declare-const m1 Real)
(assert (and (>= p 0) (>= s 0) (>= x 0)))
(assert (<= m (/ (* p p) 2)))
(assert (<= x p))  ; dropped in the twin
(assert (<= m1 (+ m (* s x) (/ (* s s) 2))))
(assert (<= (* s x) (* s p)))  ; hint
(assert (> m1 (/ (* (+ p s) (+ p s)) 2)))  ; negated conclusion
(check-sat)
