; telescoping: theory §2.3. The error of the counted work on one axis, by induction. So far it is
; f(n-1) e(n) + R with |R| <= h V, V the variation of the force, h = q/2; after one more interval
; with force f it is at most h (|f| + V + |f - f(n-1)|). Over the axes the norms become sums.
(set-logic QF_NRA)
(declare-const h Real)
(declare-const V Real)
(declare-const R Real)
(declare-const p Real)   ; f(n-1)
(declare-const f Real)   ; f(n)
(declare-const e Real)   ; error of the reading at the beginning
(declare-const g Real)   ; and at the end
(declare-const S Real)   ; error of the sum before
(declare-const U Real)   ; and after
(define-fun mag ((x Real)) Real (ite (>= x 0) x (- x)))
(assert (and (>= h 0) (>= V 0)))
(assert (<= (mag g) h))
(assert (<= (mag e) h))  ; dropped in the twin
(assert (<= (mag R) (* h V)))
(assert (= S (+ (* p e) R)))
(assert (= U (+ S (* f (- g e)))))
(assert (and (<= (* f g) (* h (mag f))) (<= (* (- f) g) (* h (mag f)))))  ; hint
(assert (and (<= (* (- f p) e) (* h (mag (- f p)))) (<= (* (- p f) e) (* h (mag (- f p))))))  ; hint
(assert (> (mag U) (+ (* h (mag f)) (* h V) (* h (mag (- f p))))))  ; negated conclusion
(check-sat)
