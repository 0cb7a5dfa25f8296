; play_operator: theory §2.3. By induction: the true path on one axis is at least the path P of the
; play operator less h = q/2, plus the distance of the true position from its output. L: the true
; path so far, x -> z the true positions, p -> r the outputs, y the next reading.
(set-logic QF_LRA)
(declare-const h Real)
(declare-const L Real)
(declare-const P Real)
(declare-const x Real)
(declare-const z Real)
(declare-const p Real)
(declare-const r Real)
(declare-const y Real)
(define-fun mag ((u Real)) Real (ite (>= u 0) u (- u)))
(assert (>= h 0))
(assert (>= L (+ (- P h) (mag (- x p)))))
(assert (<= (mag (- z y)) h))  ; dropped in the twin
(assert (= r (ite (> y (+ p h)) (- y h) (ite (< y (- p h)) (+ y h) p))))
(assert (< (+ L (mag (- z x))) (+ (- (+ P (mag (- r p))) h) (mag (- z r)))))  ; negated conclusion
(check-sat)
