; jensen: theory §2.2. Joining two stretches never raises the counted viscous loss: with lengths a, b
; and mean velocities u, v the mean velocity w of both has (a + b) w^2 <= a u^2 + b v^2. By
; induction and in the limit, integral of |v|^2 >= |d|^2 / T; per axis, so also for the norm.
; Multiplied by a + b.
(set-logic QF_NRA)
(declare-const a Real)
(declare-const b Real)
(declare-const u Real)
(declare-const v Real)
(declare-const w Real)
(declare-const d Real)  ; displacement of both
(assert (and (> a 0) (> b 0)))
(assert (= d (* (+ a b) w)))
(assert (= d (+ (* a u) (* b v))))  ; dropped in the twin
(assert (= (* d d) (* (+ (* a u) (* b v)) (+ (* a u) (* b v)))))  ; hint
(assert (>= (* a b (- u v) (- u v)) 0))  ; hint
(assert (> (* d d) (* (+ a b) (+ (* a u u) (* b v v)))))  ; negated conclusion
(check-sat)
